#pragma once

#include <memory>
#include <optional>
#include <string>

#include "camera/bounded_jpeg_encoder.h"
#include "camera/camera_config.h"
#include "camera/frame_source.h"
#include "camera/v4l2_device.h"
#include "camera/v4l2_system.h"

namespace relocd {

/// The frames of a V4L2 camera: motion JPEG as the camera made it, YUYV and GREY encoded to JPEG.
///
/// What is damaged is dropped and counted. A stream without frames is restarted, and if that does
/// not help the device is opened again; one that is gone is looked for every half second, for ever.
///
/// Borrows the V4l2System, which must outlive it.
class V4l2FrameSource final : public FrameSource {
 public:
  V4l2FrameSource(const CameraConfig& config, V4l2System& system);

  Result<void> Start(MonotonicTime now) override;
  [[nodiscard]] int fd() const override { return device_ ? device_->fd() : -1; }
  [[nodiscard]] MonotonicTime NextWakeUp() const override { return wake_up_; }
  std::optional<Frame> Next(MonotonicTime now) override;

 private:
  void TryOpen(MonotonicTime now);
  void NoteControls();
  /// Closes the device, to be opened again after a pause.
  void Lose(const std::string& why, MonotonicTime now);
  /// Restarts the stream; if that was the last thing tried, closes the device.
  void Recover(const std::string& why, MonotonicTime now);

  std::optional<V4l2Buffer> Dequeue(MonotonicTime now);
  std::optional<Frame> Fetch(const V4l2Buffer& buffer, MonotonicTime now);
  [[nodiscard]] Result<std::vector<std::uint8_t>> MakeJpeg(const V4l2Buffer& buffer);
  void CountGap(const V4l2Buffer& buffer);
  void StampTime(const V4l2Buffer& buffer, MonotonicTime now, Frame& frame) const;
  void NoteDelivery(MonotonicTime now);

  CameraConfig config_;
  V4l2System& system_;
  BoundedJpegEncoder encoder_;
  std::unique_ptr<V4l2Device> device_;
  MonotonicTime wake_up_{};
  std::optional<std::uint32_t> last_sequence_;
  bool gap_ = false;        ///< Frames before the next one were lost.
  bool restarted_ = false;  ///< The stream was restarted, and no frame came since.
  std::optional<MonotonicTime> lost_since_;
  std::string lost_because_;  ///< The first reason; problem_ is the last.
  std::string said_of_controls_;
};

}  // namespace relocd
