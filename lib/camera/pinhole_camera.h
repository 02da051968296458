#pragma once

#include <optional>

#include <Eigen/Core>

#include "camera/intrinsics.h"

namespace relocd {

/// A pinhole camera with radial and tangential lens distortion (D. C. Brown, "Close-range camera
/// calibration", 1971; the coefficients k1 k2 p1 p2 k3 mean what they mean in OpenCV).
///
/// C is the camera frame: x right, y down, z forward. Pixels are (u, v) with centres at integers.
/// Immutable, hence thread-safe.
class PinholeCamera {
 public:
  /// @param intrinsics  valid in the sense of its Validate().
  explicit PinholeCamera(const CameraIntrinsics& intrinsics);

  /// A pixel, and how it moves with the point.
  struct Projection {
    Eigen::Vector2d pixel;
    Eigen::Matrix<double, 2, 3> J_p_CP;  ///< d pixel / d p_CP, in px/m.
  };

  /// Where the point appears, also outside the image. Nothing for a point that is not in front of
  /// the camera, or so far from the axis that the distortion polynomial folds back there.
  [[nodiscard]] std::optional<Eigen::Vector2d> Project(const Eigen::Vector3d& p_CP) const;
  [[nodiscard]] std::optional<Projection> ProjectWithJacobian(const Eigen::Vector3d& p_CP) const;

  /// The (x, y) of the viewing ray (x, y, 1) in C, by Newton's method. Nothing where no ray leads
  /// to the pixel: where the iteration does not converge, or only behind the fold.
  [[nodiscard]] std::optional<Eigen::Vector2d> Unproject(const Eigen::Vector2d& pixel) const;

  [[nodiscard]] bool has_distortion() const { return has_distortion_; }
  [[nodiscard]] const CameraIntrinsics& intrinsics() const { return intrinsics_; }

 private:
  struct Distorted {
    Eigen::Vector2d point;
    Eigen::Matrix2d J;  ///< d point / d undistorted.
  };
  [[nodiscard]] Distorted Distort(const Eigen::Vector2d& undistorted) const;

  CameraIntrinsics intrinsics_;
  bool has_distortion_ = false;
  /// Up to this distance from the axis, at depth 1, the radial distortion increases.
  double max_radius_ = 0.0;
};

}  // namespace relocd
