#include "can/candump_source.h"

#include <errno.h>
#include <sys/timerfd.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "core/file.h"

namespace relocd {
namespace {

/// Opening takes a moment; frames that fell due meanwhile are still given.
constexpr Duration kLateness = std::chrono::milliseconds(500);
/// A first frame that is due later than this is more likely a recording's clock that the config
/// does not know of.
constexpr Duration kLongestWait = std::chrono::hours(1);

/// Reads a whole log, so that a line that is none is found before the robot drives by it.
Result<void> CheckLog(const std::string& path) {
  auto log = CandumpLog::Open(path);
  if (!log) return std::move(log).error();
  while (true) {
    auto record = log->Next();
    if (!record) return std::move(record).error();
    if (!record->has_value()) return {};
  }
}

}  // namespace

CandumpSource::CandumpSource(const CanConfig& config, std::vector<CanId> ids, MonotonicTime epoch)
    : path_(config.path),
      interface_(config.interface),
      ids_(std::move(ids)),
      start_ns_(std::llround(config.playback_start_s * 1e9)),
      epoch_(epoch) {}

Result<void> CandumpSource::Open() {
  if (auto ok = CheckLog(path_); !ok) return Error{ErrorKind::kInvalidInput, ok.error().message};
  auto log = CandumpLog::Open(path_);
  if (!log) return std::move(log).error();
  log_.emplace(std::move(log).value());
  UniqueFd timer(::timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC));
  if (!timer.valid()) return SystemError(ErrorKind::kUnavailable, "creating a timer");
  timer_ = std::move(timer);

  const MonotonicTime oldest = std::max(epoch_, MonotonicClock::now() - kLateness);
  do {
    if (auto ok = ReadNext(); !ok) return ok;
  } while (next_ && next_->receive_time < oldest);
  if (!next_) return {};
  if (next_->receive_time - oldest > kLongestWait) {
    const double wait_s = ToSeconds(next_->receive_time - oldest);
    timer_ = UniqueFd();
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("{}: the next frame is due in {:.0f} s, playback_start_s must be near "
                             "the recording's first time",
                             path_,
                             wait_s)};
  }
  return ArmTimer(next_->receive_time);
}

Result<std::optional<CanFrame>> CandumpSource::Receive() {
  if (!is_open() || !next_) return std::optional<CanFrame>();
  if (next_->receive_time > MonotonicClock::now()) {
    std::uint64_t expirations = 0;
    [[maybe_unused]] const ssize_t size = ::read(timer_.get(), &expirations, sizeof(expirations));
    if (auto ok = ArmTimer(next_->receive_time); !ok) return std::move(ok).error();
    return std::optional<CanFrame>();
  }
  CanFrame frame = *next_;
  ++status_.received;
  status_.state = CanBusState::kActive;
  if (auto ok = ReadNext(); !ok) {
    timer_ = UniqueFd();
    return std::move(ok).error();
  }
  if (!next_) {
    if (auto ok = ArmTimer(MonotonicTime{}); !ok) return std::move(ok).error();
  }
  return std::optional(frame);
}

Result<void> CandumpSource::ReadNext() {
  next_.reset();
  while (true) {
    auto frame = log_->NextDataFrame(interface_);
    if (!frame) return std::move(frame).error();
    if (!frame->has_value()) {
      if (!log_->LeftOut().empty()) ++status_.malformed;
      return {};
    }
    if (!IsWanted((*frame)->id)) continue;
    next_ = *frame;
    next_->receive_time = epoch_ + Duration(ToNanoseconds((*frame)->receive_time) - start_ns_);
    return {};
  }
}

bool CandumpSource::IsWanted(const CanId& id) const {
  return ids_.empty() || std::find(ids_.begin(), ids_.end(), id) != ids_.end();
}

/// A time of zero disarms.
Result<void> CandumpSource::ArmTimer(MonotonicTime due) {
  const auto since_boot = due.time_since_epoch();
  itimerspec spec{};
  spec.it_value.tv_sec = since_boot / std::chrono::seconds(1);
  spec.it_value.tv_nsec = (since_boot % std::chrono::seconds(1)).count();
  if (::timerfd_settime(timer_.get(), TFD_TIMER_ABSTIME, &spec, nullptr) != 0) {
    return SystemError(ErrorKind::kInternal, "arming a timer");
  }
  return {};
}

}  // namespace relocd
