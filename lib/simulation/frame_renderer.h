#pragma once

#include <cstdint>
#include <functional>
#include <memory>

#include "camera/image.h"
#include "camera/intrinsics.h"
#include "camera/measured_depth.h"
#include "core/result.h"
#include "geometry/pose3.h"
#include "simulation/session.h"
#include "simulation/world.h"

namespace relocd {

/// The simulated camera, and what rendering may cost.
struct FrameRendererOptions {
  CameraIntrinsics intrinsics;
  double exposure_s = 0.008;       ///< At most; sets the motion blur.
  double rolling_shutter_s = 0.0;  ///< From the first row's exposure to the last's; 0: global.
  int samples_per_pixel = 4;
  int threads = 1;
  std::uint64_t seed = 0;  ///< Of noise, dirt, rain, and where others drive and walk.
};

/// Takes the pictures of one drive: the world as the session has it, with everything that moves,
/// seen by a camera with its faults.
///
/// The same options and times give the same pictures, whatever the number of threads. Thread-bound;
/// uses threads of its own inside Render. Borrows the world, which must outlive it.
class FrameRenderer {
 public:
  /// Where the camera is at a time, near that of the frame.
  using CameraMotion = std::function<Pose3(std::int64_t time_ns)>;

  /// @return kInvalidInput for options out of range, or a scene that is not valid.
  static Result<std::unique_ptr<FrameRenderer>> Create(const World& world,
                                                       const Session& session,
                                                       const FrameRendererOptions& options);
  ~FrameRenderer();
  FrameRenderer(const FrameRenderer&) = delete;
  FrameRenderer& operator=(const FrameRenderer&) = delete;
  FrameRenderer(FrameRenderer&&) = delete;
  FrameRenderer& operator=(FrameRenderer&&) = delete;

  /// @param time_ns  the middle of the exposure of the middle row, since the drive's begin. Frames
  ///                 come in the order of their times: the exposure follows what was seen before.
  RgbImage Render(std::int64_t time_ns, const CameraMotion& camera_motion);

  /// What an ideal depth camera sees at that time, up to 65 m: without exposure, noise or rain.
  MeasuredDepth RenderDepth(std::int64_t time_ns, const CameraMotion& camera_motion);

 private:
  FrameRenderer();
  struct Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace relocd
