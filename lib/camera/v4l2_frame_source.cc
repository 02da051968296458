#include "camera/v4l2_frame_source.h"

#include <linux/videodev2.h>

#include <chrono>
#include <cmath>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "camera/jpeg.h"

namespace relocd {
namespace {

constexpr int kMostBuffers = 32;  // V4L2's own limit: a driver that fills faster must not hold us
constexpr Duration kReopenPeriod = std::chrono::milliseconds(500);
constexpr Duration kOldestStamp = std::chrono::seconds(1);
/// Two readings of one clock on two CPUs, and drivers that round up.
constexpr Duration kStampAhead = std::chrono::milliseconds(10);

Duration Milliseconds(double milliseconds) {
  return FromSeconds(milliseconds * 1e-3);
}

GrayImage CopyGrey(const V4l2Buffer& buffer, const V4l2Format& format) {
  GrayImage image{.width = format.width, .height = format.height, .pixels = {}};
  for (int v = 0; v < format.height; ++v) {
    const auto row = buffer.bytes.subspan(static_cast<std::size_t>(v) *
                                          static_cast<std::size_t>(format.bytes_per_line));
    image.pixels.insert(image.pixels.end(), row.begin(), row.begin() + format.width);
  }
  return image;
}

/// What the driver says of the rate, and what was asked where that is another.
std::string FrameRateText(const V4l2Format& format, double wanted_hz) {
  constexpr double kSame = 0.01;  // periods are fractions of whole numbers
  if (format.frame_rate_hz <= 0.0) return "";
  std::string text = fmt::format(" at {:.4g} Hz", format.frame_rate_hz);
  if (std::abs(format.frame_rate_hz - wanted_hz) <= kSame * wanted_hz) return text;
  text += fmt::format(" (asked for {:.4g}", wanted_hz);
  if (!format.offered_rates.empty()) text += ", allowed " + format.offered_rates;
  return text + ")";
}

Error Damaged(std::string message) {
  return {ErrorKind::kInvalidInput, std::move(message)};
}

}  // namespace

V4l2FrameSource::V4l2FrameSource(const CameraConfig& config, V4l2System& system)
    : config_(config), system_(system), encoder_(config.jpeg_quality, config.max_jpeg_bytes) {}

Result<void> V4l2FrameSource::Start(MonotonicTime now) {
  TryOpen(now);
  return {};
}

void V4l2FrameSource::TryOpen(MonotonicTime now) {
  auto device = V4l2Device::Open(system_, config_);
  if (!device) return Lose(device.error().message, now);
  device_ = std::move(device).value();
  last_sequence_.reset();
  restarted_ = false;
  wake_up_ = now + Milliseconds(config_.no_frame_timeout_ms);
  NoteControls();
}

/// Said again only when it changes: a device that gives no frames is opened every few seconds.
void V4l2FrameSource::NoteControls() {
  const V4l2ControlsReport& controls = device_->controls();
  remark_ = fmt::format("{}", fmt::join(controls.otherwise, "; "));
  if (!remark_.empty()) remark_ = config_.device + ": " + remark_;
  std::vector<std::string> all = controls.otherwise;
  all.insert(all.end(), controls.given.begin(), controls.given.end());
  if (all.empty()) return;
  std::string notice = fmt::format("{}: controls: {}", config_.device, fmt::join(all, "; "));
  if (notice == said_of_controls_) return;
  said_of_controls_ = notice;
  notices_.push_back(std::move(notice));
}

void V4l2FrameSource::Lose(const std::string& why, MonotonicTime now) {
  device_.reset();
  remark_.clear();
  wake_up_ = now + kReopenPeriod;
  gap_ = gap_ || counters_.delivered > 0;
  if (!lost_since_) {
    lost_since_ = now;
    lost_because_ = why;
  }
  problem_ = why;
}

void V4l2FrameSource::Recover(const std::string& why, MonotonicTime now) {
  if (restarted_) return Lose(why, now);
  ++counters_.stalls;
  if (auto ok = device_->Restart(); !ok) return Lose(ok.error().message, now);
  restarted_ = true;
  last_sequence_.reset();  // drivers count from 0 again
  gap_ = true;
  wake_up_ = now + Milliseconds(config_.no_frame_timeout_ms);
}

std::optional<Frame> V4l2FrameSource::Next(MonotonicTime now) {
  if (!device_ && now >= wake_up_) TryOpen(now);
  for (int i = 0; i < kMostBuffers; ++i) {
    const auto buffer = Dequeue(now);
    if (!buffer) return std::nullopt;
    auto frame = Fetch(*buffer, now);
    if (auto ok = device_->Requeue(*buffer); !ok) Recover(ok.error().message, now);
    if (frame) return frame;
  }
  return std::nullopt;
}

/// The oldest filled buffer; nothing when none is, which is seen to if it lasts.
std::optional<V4l2Buffer> V4l2FrameSource::Dequeue(MonotonicTime now) {
  if (!device_) return std::nullopt;
  auto buffer = device_->Dequeue();
  if (!buffer) {
    const Error error = std::move(buffer).error();
    if (error.kind == ErrorKind::kUnavailable) {
      Lose(error.message, now);
    } else {
      Recover(error.message, now);
    }
    return std::nullopt;
  }
  if (!buffer->has_value() && now >= wake_up_) {
    Recover(fmt::format("{}: gave no frame for {} ms", config_.device, config_.no_frame_timeout_ms),
            now);
  }
  return *buffer;
}

/// The frame, copied out of the buffer: it is the driver's again after this.
std::optional<Frame> V4l2FrameSource::Fetch(const V4l2Buffer& buffer, MonotonicTime now) {
  CountGap(buffer);
  auto jpeg = MakeJpeg(buffer);
  const auto size = jpeg ? ReadJpegSize(*jpeg) : Result<JpegSize>(jpeg.error());
  if (!size) {
    ++counters_.damaged;
    gap_ = true;
    return std::nullopt;
  }
  Frame frame{.bytes = std::move(jpeg).value(),
              .fourcc = kFourccMjpeg,
              .width = size->width,
              .height = size->height,
              .bytes_per_line = 0,
              .time = {},
              .sequence = buffer.sequence,
              .flags = std::exchange(gap_, false) ? kFrameAfterGap : 0,
              .exposure_us = device_->controls().exposure_us};
  StampTime(buffer, now, frame);
  NoteDelivery(now);
  return frame;
}

Result<std::vector<std::uint8_t>> V4l2FrameSource::MakeJpeg(const V4l2Buffer& buffer) {
  if ((buffer.flags & V4L2_BUF_FLAG_ERROR) != 0) return Damaged("the driver says so");
  const V4l2Format& format = device_->format();
  if (format.fourcc == kFourccMjpeg) {
    const auto jpeg = FindWholeJpeg(buffer.bytes);
    if (!jpeg) return Damaged("the JPEG has no start or no end");
    return std::vector<std::uint8_t>(jpeg->begin(), jpeg->end());
  }
  if (format.fourcc == kFourccYuyv) {
    return encoder_.Encode(
        YuyvView{buffer.bytes, format.width, format.height, format.bytes_per_line});
  }
  const std::int64_t needed =
      std::int64_t{format.bytes_per_line} * (format.height - 1) + format.width;
  if (std::ssize(buffer.bytes) < needed) return Damaged("the image is cut short");
  return encoder_.Encode(CopyGrey(buffer, format));
}

void V4l2FrameSource::CountGap(const V4l2Buffer& buffer) {
  // Unsigned, so that the driver's counter may wrap; some drivers leave it at zero.
  constexpr std::uint32_t kHalf = 1U << 31U;
  if (last_sequence_) {
    const std::uint32_t step = buffer.sequence - *last_sequence_;
    if (step > 1 && step < kHalf) {
      counters_.dropped += step - 1;
      gap_ = true;
    }
  }
  last_sequence_ = buffer.sequence;
}

void V4l2FrameSource::StampTime(const V4l2Buffer& buffer, MonotonicTime now, Frame& frame) const {
  const bool is_monotonic =
      (buffer.flags & V4L2_BUF_FLAG_TIMESTAMP_MASK) == V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC;
  const bool is_plausible = buffer.stamp <= now + kStampAhead && buffer.stamp >= now - kOldestStamp;
  if (is_monotonic && is_plausible) {
    frame.time = buffer.stamp;
  } else {
    frame.time = now;
    frame.flags |= kFrameTimeOfReceipt;
  }
  if (frame.exposure_us > 0) {
    const Duration half = std::chrono::microseconds(frame.exposure_us) / 2;
    const bool at_start =
        (buffer.flags & V4L2_BUF_FLAG_TSTAMP_SRC_MASK) == V4L2_BUF_FLAG_TSTAMP_SRC_SOE;
    frame.time += at_start ? half : -half;
  }
  frame.time += Milliseconds(config_.time_offset_ms);
}

void V4l2FrameSource::NoteDelivery(MonotonicTime now) {
  ++counters_.delivered;
  restarted_ = false;
  wake_up_ = now + Milliseconds(config_.no_frame_timeout_ms);
  if (counters_.delivered > 1 && !lost_since_) return;
  const V4l2Format& format = device_->format();
  std::string notice = fmt::format("{}: {} {} x {} px{}",
                                   config_.device,
                                   FourccText(format.fourcc),
                                   format.width,
                                   format.height,
                                   FrameRateText(format, config_.frame_rate_hz));
  if (lost_since_) {
    ++counters_.reopened;
    notice +=
        fmt::format(", back after {:.1f} s ({}", ToSeconds(now - *lost_since_), lost_because_);
    notice += problem_ == lost_because_ ? ")" : "; " + problem_ + ")";
  }
  notices_.push_back(std::move(notice));
  lost_since_.reset();
  problem_.clear();
}

}  // namespace relocd
