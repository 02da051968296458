#include "can/can_socket.h"

#include <errno.h>
#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/socket.h>
#include <time.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstring>
#include <utility>

#include <fmt/format.h>

#include "core/file.h"

namespace relocd {
namespace {

/// Frames wait in the kernel while this process does not run. A stamp that seems older than this is
/// the wall clock having been set, not a frame that waited.
constexpr Duration kMaxAge = std::chrono::seconds(10);

/// What the kernel says of one record, besides its bytes.
struct ReceiveMetadata {
  std::optional<std::chrono::nanoseconds> realtime;  ///< CLOCK_REALTIME of the reception.
  std::optional<std::uint32_t> dropped;              ///< Since the socket was opened.
};

ReceiveMetadata ReadMetadata(msghdr& message) {
  ReceiveMetadata metadata;
  for (cmsghdr* header = CMSG_FIRSTHDR(&message); header != nullptr;
       header = CMSG_NXTHDR(&message, header)) {
    if (header->cmsg_level != SOL_SOCKET) continue;
    if (header->cmsg_type == SO_TIMESTAMPNS) {
      timespec stamp{};
      std::memcpy(&stamp, CMSG_DATA(header), sizeof(stamp));
      metadata.realtime = std::chrono::seconds(stamp.tv_sec) + Duration(stamp.tv_nsec);
    } else if (header->cmsg_type == SO_RXQ_OVFL) {
      std::uint32_t dropped = 0;
      std::memcpy(&dropped, CMSG_DATA(header), sizeof(dropped));
      metadata.dropped = dropped;
    }
  }
  return metadata;
}

/// CLOCK_REALTIME minus CLOCK_MONOTONIC now, and the latter. Reading them takes two calls, between
/// which the process may lose the CPU: the best of a few tries counts.
struct ClockOffset {
  Duration offset{};
  MonotonicTime now{};
};

ClockOffset ReadClockOffset() {
  constexpr Duration kGoodEnough = std::chrono::microseconds(5);
  ClockOffset best;
  Duration best_spread = Duration::max();
  for (int i = 0; i < 3 && best_spread > kGoodEnough; ++i) {
    const MonotonicTime before = MonotonicClock::now();
    const auto realtime = std::chrono::system_clock::now().time_since_epoch();
    const MonotonicTime after = MonotonicClock::now();
    if (after - before >= best_spread) continue;
    best_spread = after - before;
    const MonotonicTime middle = before + best_spread / 2;
    best = {.offset = realtime - middle.time_since_epoch(), .now = after};
  }
  return best;
}

/// When a frame was received, in [not_before, now] and at most kMaxAge ago.
MonotonicTime ToMonotonic(const ReceiveMetadata& metadata, MonotonicTime not_before) {
  const ClockOffset clocks = ReadClockOffset();
  if (!metadata.realtime) return clocks.now;
  const MonotonicTime time(*metadata.realtime - clocks.offset);
  return std::clamp(time, std::max(not_before, clocks.now - kMaxAge), clocks.now);
}

/// Whether the record is a whole struct can_frame or canfd_frame with a possible length.
bool IsFrame(const canfd_frame& raw, std::size_t size) {
  if (size == CAN_MTU) return raw.len <= CAN_MAX_DLEN;
  return size == CANFD_MTU && raw.len <= CANFD_MAX_DLEN;
}

CanFrame FrameFromRaw(const canfd_frame& raw, std::size_t size) {
  CanFrame frame;
  SetKernelCanId(frame, raw.can_id);
  frame.fd = size == CANFD_MTU;
  frame.bit_rate_switch = frame.fd && (raw.flags & CANFD_BRS) != 0;
  frame.error_state_indicator = frame.fd && (raw.flags & CANFD_ESI) != 0;
  frame.SetPayload({static_cast<const std::uint8_t*>(raw.data), raw.len});
  return frame;
}

/// Best effort: without them frames are stamped when they are read, and drops are not counted.
void RequestMetadata(int fd) {
  const int enable = 1;
  ::setsockopt(fd, SOL_SOCKET, SO_TIMESTAMPNS, &enable, sizeof(enable));
  ::setsockopt(fd, SOL_SOCKET, SO_RXQ_OVFL, &enable, sizeof(enable));
}

Result<void> SetFilters(int fd, const std::vector<CanId>& ids) {
  const can_err_mask_t errors = CAN_ERR_MASK;
  if (::setsockopt(fd, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &errors, sizeof(errors)) != 0) {
    return SystemError(ErrorKind::kUnavailable, "asking for CAN error frames");
  }
  if (ids.empty()) return {};
  std::vector<can_filter> filters;
  for (const CanId& id : ids) {
    const std::uint32_t mask = id.extended ? kCanExtendedMask : kCanStandardMask;
    filters.push_back({.can_id = id.value | (id.extended ? kCanExtendedFlag : 0),
                       .can_mask = mask | kCanExtendedFlag | kCanRemoteFlag});
  }
  const auto size = static_cast<socklen_t>(filters.size() * sizeof(can_filter));
  if (::setsockopt(fd, SOL_CAN_RAW, CAN_RAW_FILTER, filters.data(), size) != 0) {
    return SystemError(ErrorKind::kUnavailable,
                       fmt::format("setting {} CAN filters", filters.size()));
  }
  return {};
}

}  // namespace

Result<CanSocket> CanSocket::Open(const std::string& interface, const CanSocketOptions& options) {
  UniqueFd fd(::socket(PF_CAN, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, CAN_RAW));
  if (!fd.valid()) return SystemError(ErrorKind::kUnavailable, "opening a raw CAN socket");

  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = static_cast<int>(::if_nametoindex(interface.c_str()));
  if (address.can_ifindex == 0) {
    return SystemError(ErrorKind::kUnavailable, fmt::format("CAN interface '{}'", interface));
  }
  if (auto ok = SetFilters(fd.get(), options.ids); !ok) return std::move(ok).error();
  const int enable = 1;
  if (options.fd_frames &&
      ::setsockopt(fd.get(), SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &enable, sizeof(enable)) != 0) {
    return SystemError(ErrorKind::kUnavailable,
                       fmt::format("asking for CAN FD frames of '{}'", interface));
  }
  if (::bind(fd.get(), reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0) {
    return SystemError(ErrorKind::kUnavailable,
                       fmt::format("binding to CAN interface '{}'", interface));
  }
  return FromFd(std::move(fd), options);
}

CanSocket CanSocket::FromFd(UniqueFd fd, const CanSocketOptions& options) {
  RequestMetadata(fd.get());
  return {std::move(fd), options.ids};
}

Result<std::optional<CanFrame>> CanSocket::Receive() {
  while (true) {
    canfd_frame raw{};
    std::array<char, CMSG_SPACE(sizeof(timespec)) + CMSG_SPACE(sizeof(std::uint32_t))> control{};
    iovec buffer{&raw, sizeof(raw)};
    msghdr message{};
    message.msg_iov = &buffer;
    message.msg_iovlen = 1;
    message.msg_control = control.data();
    message.msg_controllen = control.size();

    // With MSG_TRUNC the size is that of the record, also where it was longer than a frame.
    const ssize_t size = ::recvmsg(fd_.get(), &message, MSG_TRUNC);
    if (size < 0 && errno == EINTR) continue;
    if (size < 0) return HandleReceiveError(errno);
    if (size == 0) {
      return Error{ErrorKind::kUnavailable, "receiving from the CAN bus: the peer closed"};
    }
    if (!IsFrame(raw, static_cast<std::size_t>(size))) {
      ++status_.malformed;
      continue;
    }
    const ReceiveMetadata metadata = ReadMetadata(message);
    if (metadata.dropped) status_.dropped = *metadata.dropped;

    CanFrame frame = FrameFromRaw(raw, static_cast<std::size_t>(size));
    frame.receive_time = ToMonotonic(metadata, last_receive_time_);
    last_receive_time_ = frame.receive_time;
    if (auto wanted = HandleFrame(frame)) return wanted;
  }
}

Result<std::optional<CanFrame>> CanSocket::HandleReceiveError(int error) {
  if (error == EAGAIN || error == EWOULDBLOCK) return std::optional<CanFrame>();
  if (error == ENETDOWN) {
    // The socket stays bound: frames come again when the interface is up.
    if (status_.state != CanBusState::kInterfaceDown) ++status_.interface_down;
    status_.state = CanBusState::kInterfaceDown;
    return std::optional<CanFrame>();
  }
  errno = error;
  return SystemError(ErrorKind::kUnavailable, "receiving from the CAN bus");
}

std::optional<CanFrame> CanSocket::HandleFrame(const CanFrame& frame) {
  if (frame.error) {
    HandleErrorFrame(frame);
    return std::nullopt;
  }
  if (frame.remote) {
    ++status_.remote_frames;
    return std::nullopt;
  }
  if (!IsWanted(frame.id)) return std::nullopt;
  ++status_.received;
  // A frame that was received is proof of a controller on the bus, whatever was missed meanwhile.
  if (status_.state == CanBusState::kUnknown || status_.state == CanBusState::kBusOff ||
      status_.state == CanBusState::kInterfaceDown) {
    status_.state = CanBusState::kActive;
  }
  return frame;
}

bool CanSocket::IsWanted(const CanId& id) const {
  return ids_.empty() || std::find(ids_.begin(), ids_.end(), id) != ids_.end();
}

void CanSocket::HandleErrorFrame(const CanFrame& frame) {
  ++status_.error_frames;
  const std::uint32_t classes = frame.id.value;
  if ((classes & CAN_ERR_BUSOFF) != 0) {
    if (status_.state != CanBusState::kBusOff) ++status_.bus_off;
    status_.state = CanBusState::kBusOff;
    return;
  }
  if ((classes & CAN_ERR_RESTARTED) != 0) status_.state = CanBusState::kActive;
  if ((classes & CAN_ERR_CRTL) == 0 || frame.size < 2) return;
  const std::uint8_t detail = frame.data[1];
  if ((detail & (CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE)) != 0) {
    status_.state = CanBusState::kPassive;
  } else if ((detail & (CAN_ERR_CRTL_RX_WARNING | CAN_ERR_CRTL_TX_WARNING)) != 0) {
    status_.state = CanBusState::kWarning;
  } else if ((detail & CAN_ERR_CRTL_ACTIVE) != 0) {
    status_.state = CanBusState::kActive;
  }
}

}  // namespace relocd
