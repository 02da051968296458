#pragma once

#include <array>

#include "core/result.h"

namespace relocd {

/// A pinhole camera with the distortion of Brown and Conrady, as OpenCV orders it. Pixel centres
/// are at integers: the middle of the image's first pixel is (0, 0).
struct CameraIntrinsics {
  double fx = 0.0;                     ///< px, > 0
  double fy = 0.0;                     ///< px, > 0
  double cx = 0.0;                     ///< px, inside the image
  double cy = 0.0;                     ///< px, inside the image
  int width = 0;                       ///< px, in [1, kMaxImageSide]
  int height = 0;                      ///< px, in [1, kMaxImageSide]
  std::array<double, 5> distortion{};  ///< k1 k2 p1 p2 k3

  /// @return kInvalidInput, naming the field, its value and what is allowed.
  [[nodiscard]] Result<void> Validate() const;

  friend bool operator==(const CameraIntrinsics&, const CameraIntrinsics&) = default;
};

}  // namespace relocd
