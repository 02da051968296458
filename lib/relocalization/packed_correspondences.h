#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "camera/pinhole_camera.h"
#include "relocalization/correspondence.h"
#include "relocalization/lanes.h"
#include "relocalization/p3p.h"

namespace relocd {

/// Correspondences as the inner loops read them: undistorted, in random order, each coordinate an
/// array of floats of its own.
///
/// - Pixels are those of the undistorted image, from the principal point: (u, v) = (fx X/Z, fy
/// Y/Z).
/// - Points are in a frame M (middle), which is W moved to about the middle of the points, so that
///   floats resolve micrometres also where the coordinates of W are large.
/// - The order is shuffled, so that any prefix is a random subset.
/// - The arrays are padded to a multiple of kLanes with correspondences that no pose explains.
///
/// What is not finite, or has no ray of light in the camera's model, is left out.
class PackedCorrespondences {
 public:
  PackedCorrespondences(std::span<const Correspondence> correspondences,
                        const PinholeCamera& camera,
                        std::uint64_t seed);

  [[nodiscard]] std::size_t size() const { return size_; }
  /// The smallest multiple of kLanes that holds `count` correspondences, or all there are.
  [[nodiscard]] std::size_t PaddedSize(std::size_t count) const;

  [[nodiscard]] const float* x() const { return data_.data(); }
  [[nodiscard]] const float* y() const { return data_.data() + stride_; }
  [[nodiscard]] const float* z() const { return data_.data() + 2 * stride_; }
  [[nodiscard]] const float* u() const { return data_.data() + 3 * stride_; }
  [[nodiscard]] const float* v() const { return data_.data() + 4 * stride_; }

  [[nodiscard]] Eigen::Vector3d p_MP(std::size_t i) const { return {x()[i], y()[i], z()[i]}; }
  [[nodiscard]] Eigen::Vector2d pixel(std::size_t i) const { return {u()[i], v()[i]}; }
  /// The unit vector towards the pixel.
  [[nodiscard]] Eigen::Vector3d Ray_C(std::size_t i) const {
    return Eigen::Vector3d(u()[i] / focal_.x(), v()[i] / focal_.y(), 1.0).normalized();
  }

  /// Indices of the more confident half, and of those that are as confident as its last; of few
  /// correspondences, all.
  [[nodiscard]] std::span<const std::uint32_t> likely() const { return likely_; }

  [[nodiscard]] const Eigen::Vector2d& focal() const { return focal_; }  ///< (fx, fy), px.
  [[nodiscard]] const Eigen::Vector3d& p_WM() const { return p_WM_; }

 private:
  std::size_t size_ = 0;
  std::size_t stride_ = 0;
  Eigen::Vector2d focal_;
  Eigen::Vector3d p_WM_ = Eigen::Vector3d::Zero();
  std::vector<float> data_;
  std::vector<std::uint32_t> likely_;
};

}  // namespace relocd
