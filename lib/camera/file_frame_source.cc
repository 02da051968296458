#include "camera/file_frame_source.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include <fmt/format.h>

#include "camera/jpeg.h"
#include "core/file.h"
#include "core/index_range.h"

namespace relocd {
namespace {

/// Starting takes a moment, and a busy machine is late at times: frames that fell due meanwhile are
/// still given. Older ones are dropped, as a camera's would be.
constexpr Duration kLateness = std::chrono::milliseconds(500);
/// A first frame that is due later than this is more likely a recording's clock that the config
/// does not know of.
constexpr Duration kLongestWait = std::chrono::hours(1);
constexpr double kNanosecondsPerSecond = 1e9;

}  // namespace

Result<std::unique_ptr<FileFrameSource>> FileFrameSource::Open(const FileCameraConfig& config,
                                                               MonotonicTime epoch) {
  auto dataset = ReadDataset(config.dataset);
  if (!dataset) return std::move(dataset).error();
  auto range = ParseIndexRange(config.frames, dataset->frames.size());
  if (!range) return std::move(range).error().WithContext(config.dataset + "/frames.txt");
  std::vector<DatasetFrame> frames(
      dataset->frames.begin() + static_cast<std::ptrdiff_t>(range->begin),
      dataset->frames.begin() + static_cast<std::ptrdiff_t>(range->end));
  return std::unique_ptr<FileFrameSource>(new FileFrameSource(std::move(frames), config, epoch));
}

FileFrameSource::FileFrameSource(std::vector<DatasetFrame> frames,
                                 const FileCameraConfig& config,
                                 MonotonicTime epoch)
    : frames_(std::move(frames)),
      start_ns_(std::llround(config.playback_start_s * kNanosecondsPerSecond)),
      rate_(config.rate),
      epoch_(epoch) {}

Result<void> FileFrameSource::Start(MonotonicTime now) {
  if (rate_ > 0.0) DropOlderThan(now - kLateness);
  if (ended()) return {};
  const Duration wait = DueTime(next_) - std::max(now, epoch_);
  if (rate_ > 0.0 && wait > kLongestWait) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("{}: is due in {:.0f} s, file.playback_start_s must be near its "
                             "recorded time of {:.3f} s",
                             frames_[next_].image_path,
                             ToSeconds(wait),
                             static_cast<double>(frames_[next_].time_ns) / kNanosecondsPerSecond)};
  }
  return {};
}

MonotonicTime FileFrameSource::NextWakeUp() const {
  if (ended()) return MonotonicTime::max();
  return rate_ > 0.0 ? DueTime(next_) : MonotonicTime::min();
}

std::optional<Frame> FileFrameSource::Next(MonotonicTime now) {
  if (rate_ > 0.0) DropOlderThan(now - kLateness);
  while (!ended() && NextWakeUp() <= now) {
    const std::size_t i = next_++;
    auto frame = Read(frames_[i]);
    if (!frame) continue;
    frame->time = DueTime(i);
    ++counters_.delivered;
    return frame;
  }
  return std::nullopt;
}

MonotonicTime FileFrameSource::DueTime(std::size_t i) const {
  const auto since_start = static_cast<double>(frames_[i].time_ns - start_ns_);
  return epoch_ + Duration(std::llround(rate_ > 0.0 ? since_start / rate_ : since_start));
}

void FileFrameSource::DropOlderThan(MonotonicTime oldest) {
  for (; !ended() && DueTime(next_) < oldest; ++next_) {
    ++counters_.dropped;
    gap_ = true;
  }
}

std::optional<Frame> FileFrameSource::Read(const DatasetFrame& recorded) {
  const auto bytes = ReadFile(recorded.image_path);
  const auto size = bytes ? ReadJpegSize(AsBytes(*bytes)) : Result<JpegSize>(bytes.error());
  if (!size) {
    ++counters_.damaged;
    gap_ = true;
    const std::string& why = size.error().message;
    notices_.push_back(bytes ? recorded.image_path + ": " + why : why);
    return std::nullopt;
  }
  const auto jpeg = AsBytes(*bytes);
  return Frame{.bytes = {jpeg.begin(), jpeg.end()},
               .fourcc = kFourccMjpeg,
               .width = size->width,
               .height = size->height,
               .bytes_per_line = 0,
               .time = {},
               .sequence = recorded.index,
               .flags = std::exchange(gap_, false) ? kFrameAfterGap : 0,
               .exposure_us = -1};
}

}  // namespace relocd
