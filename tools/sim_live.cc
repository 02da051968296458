#include "sim_live.h"

#include <algorithm>
#include <chrono>
#include <cstdio>

#include <fmt/format.h>

#include "camera/frame_source.h"
#include "camera/jpeg.h"
#include "core/playback_epoch.h"

namespace relocd {
namespace {

/// Between the begin and the first frame: a moment to connect in.
constexpr Duration kLeadTime = std::chrono::milliseconds(500);

double Milliseconds(Duration duration) {
  return ToSeconds(duration) * 1e3;
}

}  // namespace

void AddLiveOptions(CLI::App& app, LiveOptions& options) {
  app.add_option("--live-can",
                 options.can,
                 "send the CAN frames on time onto this interface (vcan0), or to who connects to "
                 "unix:PATH")
      ->type_name("TARGET");
  app.add_option("--live-video",
                 options.video,
                 "show the images on time on this V4L2 output device (v4l2loopback)")
      ->type_name("DEVICE");
  app.add_option("--pixel-format", options.pixel_format, "of --live-video: MJPG or YUYV")
      ->check(CLI::IsMember({"MJPG", "YUYV"}))
      ->capture_default_str();
}

Result<std::unique_ptr<LiveDevices>> LiveDevices::Open(const LiveOptions& options,
                                                       const Images& images) {
  std::unique_ptr<LiveDevices> devices(new LiveDevices);
  if (!options.can.empty()) {
    auto can = CanOutput::Open(options.can);
    if (!can) return std::move(can).error().WithContext("--live-can");
    devices->can_ = std::move(can).value();
  }
  if (!options.video.empty()) {
    auto video =
        V4l2Output::Open(devices->kernel_,
                         options.video,
                         {.fourcc = options.pixel_format == "YUYV" ? kFourccYuyv : kFourccMjpeg,
                          .width = images.width,
                          .height = images.height,
                          .frame_rate_hz = images.frame_rate_hz});
    if (!video) return std::move(video).error().WithContext("--live-video");
    devices->video_ = std::move(video).value();
  }
  return devices;
}

LivePlayer::Outputs LiveDevices::outputs() {
  LivePlayer::Outputs outputs;
  if (can_ != nullptr)
    outputs.send_frame = [this](const CanFrame& frame) { return can_->Send(frame); };
  if (video_ == nullptr) return outputs;
  outputs.show_image = [this](const std::vector<std::uint8_t>& jpeg) -> Result<void> {
    if (video_->format().fourcc == kFourccMjpeg) return video_->Write(jpeg);
    auto yuyv = DecodeJpegToYuyv(jpeg);
    if (!yuyv) return std::move(yuyv).error();
    return video_->Write(*yuyv);
  };
  return outputs;
}

std::string LiveDevices::Summary(const LivePlayer::Counters& counters) const {
  std::string summary;
  if (can_ != nullptr) {
    summary += fmt::format(
        "live: {} CAN frames, {} more than {:.0f} ms late (at most {:.1f} ms), {} not taken\n",
        counters.frames,
        counters.late_frames,
        Milliseconds(LivePlayer::kLate),
        Milliseconds(counters.worst_frame),
        can_->counters().dropped);
  }
  if (video_ != nullptr) {
    summary += fmt::format(
        "live: {} images, {} more than {:.0f} ms late (at most {:.1f} ms), {} dropped\n",
        counters.images,
        counters.late_images,
        Milliseconds(LivePlayer::kLate),
        Milliseconds(counters.worst_image),
        counters.dropped_images);
  }
  return summary;
}

LiveDrive::LiveDrive(std::vector<CandumpRecord> frames,
                     std::vector<std::int64_t> image_times_ns,
                     LiveDevices& devices) {
  LivePlayer::Drive drive{
      .frames = std::move(frames), .image_times_ns = std::move(image_times_ns), .image = {}};
  drive.image = [this](std::size_t index) -> Result<std::optional<std::vector<std::uint8_t>>> {
    const std::lock_guard lock(mutex_);
    if (index >= images_.size()) return std::optional<std::vector<std::uint8_t>>();
    return std::optional(images_[index]);
  };
  player_ =
      std::make_unique<LivePlayer>(std::move(drive), devices.outputs(), LivePlayer::WallClock());
}

LiveDrive::~LiveDrive() {
  stop_ = true;
}

void LiveDrive::Begin() {
  const MonotonicTime epoch = LiveEpoch();
  thread_ = std::jthread([this, epoch] {
    auto played = player_->Play(epoch, stop_);
    const std::lock_guard lock(mutex_);
    if (!played) error_ = std::move(played).error();
  });
}

Result<void> LiveDrive::AddImage(const std::vector<std::uint8_t>& jpeg) {
  bool is_first = false;
  {
    const std::lock_guard lock(mutex_);
    is_first = images_.empty();
    images_.push_back(jpeg);
  }
  if (is_first) Begin();
  return ErrorSoFar();
}

Result<void> LiveDrive::Finish() {
  if (thread_.joinable()) thread_.join();
  return ErrorSoFar();
}

Result<void> LiveDrive::ErrorSoFar() {
  const std::lock_guard lock(mutex_);
  if (error_) return *error_;
  return {};
}

MonotonicTime LiveEpoch() {
  const MonotonicTime epoch = PlaybackEpoch(MonotonicClock::now() + kLeadTime);
  fmt::print(stderr, "live: the drive begins at {} ns of CLOCK_MONOTONIC\n", ToNanoseconds(epoch));
  return epoch;
}

}  // namespace relocd
