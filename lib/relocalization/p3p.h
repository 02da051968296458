#pragma once

#include <array>
#include <cstddef>

#include <Eigen/Core>

namespace relocd {

/// The pose of the world in the camera, `p_CP = R_CW * p_WP + p_CW`, in the form that inner loops
/// use: without the square roots that keep a quaternion of unit length.
struct CameraFromWorld {
  Eigen::Matrix3d R_CW = Eigen::Matrix3d::Identity();
  Eigen::Vector3d p_CW = Eigen::Vector3d::Zero();

  Eigen::Vector3d operator*(const Eigen::Vector3d& p_WP) const { return R_CW * p_WP + p_CW; }
};

/// Up to four poses, in the memory of the caller.
class P3pSolutions {
 public:
  void Add(const CameraFromWorld& solution) { solutions_[count_++] = solution; }

  [[nodiscard]] std::size_t size() const { return count_; }
  [[nodiscard]] const CameraFromWorld* begin() const { return solutions_.data(); }
  [[nodiscard]] const CameraFromWorld* end() const { return solutions_.data() + count_; }

  /// The three points are (nearly) on a line or the three rays (nearly) coincide, so that
  /// infinitely many poses explain them, or an input is not finite.
  bool degenerate = false;

 private:
  std::array<CameraFromWorld, 4> solutions_;
  std::size_t count_ = 0;
};

/// All poses of a camera that sees three points along three rays, with the points in front of it.
///
/// The depths along the rays solve three quadrics; two combinations of these are conics in the
/// projective plane of the depths, and their intersections are found by way of the degenerate conic
/// of their pencil, which is a pair of lines: Y. Ding, J. Yang, V. Larsson, C. Olsson and K.
/// Astrom, "Revisiting the P3P Problem", CVPR 2023. The depths are then polished by Newton's method
/// as in M. Persson and K. Nordberg, "Lambda Twist", ECCV 2018.
///
/// @param rays_C  unit vectors, one a column.
/// @param p_WPs   the points, one a column.
P3pSolutions SolveP3p(const Eigen::Matrix3d& rays_C, const Eigen::Matrix3d& p_WPs);

}  // namespace relocd
