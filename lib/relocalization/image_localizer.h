#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "camera/image.h"
#include "camera/intrinsics.h"
#include "core/result.h"
#include "core/time.h"
#include "relocalization/camera_pose_estimator.h"
#include "relocalization/region_selector.h"

namespace relocd {

/// What an image says of where its camera was, and how long that took.
struct ImageLocalization {
  CameraPoseResult pose;
  int region = -1;  ///< Of the map, where the pose is from; -1 without a pose.
  int regions_tried = 0;
  Duration features_time{};
  Duration head_time{};
  Duration pose_time{};
};

/// Image in, pose of the camera in the map out: a map that is ready to be used.
class ImageLocalizer {
 public:
  /// Stage times come from it: the real clock, or one that stands still so that a replay gives the
  /// same bytes each time.
  using Clock = std::function<MonotonicTime()>;

  ImageLocalizer() = default;
  virtual ~ImageLocalizer() = default;
  ImageLocalizer(const ImageLocalizer&) = delete;
  ImageLocalizer& operator=(const ImageLocalizer&) = delete;
  ImageLocalizer(ImageLocalizer&&) = delete;
  ImageLocalizer& operator=(ImageLocalizer&&) = delete;

  /// The camera that the map was made for.
  [[nodiscard]] virtual const CameraIntrinsics& camera() const = 0;
  /// Whether the network runs in bfloat16, where that was found to be faster than float.
  [[nodiscard]] virtual bool uses_bfloat16() const { return false; }
  /// The sha256 of the map in hexadecimal.
  [[nodiscard]] virtual const std::string& map_id() const = 0;

  /// @param prior  where the camera is expected, if that is known: tells where to look first,
  ///         competes on equal terms with what the image says, and a pose that agrees with it needs
  ///         less support.
  /// @param seed  of the random draws.
  /// @return kInvalidInput when the image has not the size of the map's camera.
  virtual Result<ImageLocalization> Localize(const GrayImage& image,
                                             const std::optional<CameraPrior>& prior,
                                             std::uint64_t seed,
                                             const Clock& clock) = 0;
};

}  // namespace relocd
