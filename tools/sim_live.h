#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

#include "camera/v4l2_output.h"
#include "camera/v4l2_system.h"
#include "can/can_output.h"
#include "core/result.h"
#include "simulation/live_player.h"

namespace relocd {

/// Where a drive appears live.
struct LiveOptions {
  std::string can;    ///< An interface, or unix:PATH; empty for nowhere.
  std::string video;  ///< A V4L2 output device; empty for nowhere.
  std::string pixel_format = "MJPG";

  [[nodiscard]] bool IsAny() const { return !can.empty() || !video.empty(); }
};

void AddLiveOptions(CLI::App& app, LiveOptions& options);

/// The devices that stand in for a robot's bus and camera.
class LiveDevices {
 public:
  /// What images are like.
  struct Images {
    int width = 0;   ///< px
    int height = 0;  ///< px
    double frame_rate_hz = 0.0;
  };

  /// Opens what the options name.
  ///
  /// @return kUnavailable when a device is not there, or not of the right kind.
  static Result<std::unique_ptr<LiveDevices>> Open(const LiveOptions& options,
                                                   const Images& images);

  /// They borrow this.
  [[nodiscard]] LivePlayer::Outputs outputs();
  [[nodiscard]] bool has_video() const { return video_ != nullptr; }

  /// What was sent, and how late, for people.
  [[nodiscard]] std::string Summary(const LivePlayer::Counters& counters) const;

 private:
  LiveDevices() = default;

  KernelV4l2System kernel_;
  std::unique_ptr<CanOutput> can_;
  std::unique_ptr<V4l2Output> video_;
};

/// A drive that is played while its images are still being rendered, on a thread of its own.
///
/// Its time begins soon after the first image is there, or as the environment asks for
/// (core/playback_epoch.h). Borrows the devices, which must outlive it.
class LiveDrive {
 public:
  LiveDrive(std::vector<CandumpRecord> frames,
            std::vector<std::int64_t> image_times_ns,
            LiveDevices& devices);
  ~LiveDrive();
  LiveDrive(const LiveDrive&) = delete;
  LiveDrive& operator=(const LiveDrive&) = delete;
  LiveDrive(LiveDrive&&) = delete;
  LiveDrive& operator=(LiveDrive&&) = delete;

  /// Begins, with or without an image; once.
  void Begin();

  /// The next image. Begins with the first one. @return the error that ended playing.
  Result<void> AddImage(const std::vector<std::uint8_t>& jpeg);

  /// Waits until all is played.
  Result<void> Finish();

  /// To be called after Finish.
  [[nodiscard]] const LivePlayer::Counters& counters() const { return player_->counters(); }

 private:
  [[nodiscard]] Result<void> ErrorSoFar();

  std::mutex mutex_;
  std::vector<std::vector<std::uint8_t>> images_;  ///< Guarded by mutex_.
  std::optional<Error> error_;                     ///< Guarded by mutex_.
  std::atomic<bool> stop_ = false;
  std::unique_ptr<LivePlayer> player_;
  std::jthread thread_;  ///< Last: it uses the others.
};

/// When a drive that is played begins: as the environment says, or soon.
MonotonicTime LiveEpoch();

}  // namespace relocd
