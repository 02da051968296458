#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "camera/camera_config.h"
#include "camera/dataset.h"
#include "camera/frame_source.h"

namespace relocd {

/// Plays the JPEGs of a data set in a camera's place: an image recorded t after `playback_start_s`
/// comes, and is stamped, at `epoch` + t / rate. Started in the middle, it resumes in the middle.
/// With a rate of 0 images come as fast as they are asked for, and are stamped `epoch` + t.
///
/// A file that is missing or no JPEG is counted, said, and passed over.
class FileFrameSource final : public FrameSource {
 public:
  /// @return kInvalidInput for a bad data set or range of frames; kUnavailable when a file of the
  /// data set cannot be read.
  static Result<std::unique_ptr<FileFrameSource>> Open(const FileCameraConfig& config,
                                                       MonotonicTime epoch);

  Result<void> Start(MonotonicTime now) override;
  [[nodiscard]] int fd() const override { return -1; }
  [[nodiscard]] MonotonicTime NextWakeUp() const override;
  std::optional<Frame> Next(MonotonicTime now) override;
  [[nodiscard]] bool ended() const override { return next_ == frames_.size(); }

 private:
  FileFrameSource(std::vector<DatasetFrame> frames,
                  const FileCameraConfig& config,
                  MonotonicTime epoch);

  [[nodiscard]] MonotonicTime DueTime(std::size_t i) const;
  void DropOlderThan(MonotonicTime oldest);
  std::optional<Frame> Read(const DatasetFrame& recorded);

  std::vector<DatasetFrame> frames_;
  std::int64_t start_ns_;
  double rate_;
  MonotonicTime epoch_;
  std::size_t next_ = 0;
  bool gap_ = false;  ///< Frames before the next one were passed over.
};

}  // namespace relocd
