#include "geometry/alignment.h"

#include <cmath>
#include <utility>

#include <Eigen/LU>
#include <Eigen/SVD>
#include <fmt/format.h>

namespace relocd {
namespace {

/// Both clouds' centres, and the mean of (p_A - centre_A) (p_B - centre_B)^T.
template <int kDimension>
struct CrossCovariance {
  using Vector = Eigen::Matrix<double, kDimension, 1>;

  Vector centre_A = Vector::Zero();
  Vector centre_B = Vector::Zero();
  Eigen::Matrix<double, kDimension, kDimension> sigma =
      Eigen::Matrix<double, kDimension, kDimension>::Zero();

  CrossCovariance(std::span<const Vector> p_APs, std::span<const Vector> p_BPs) {
    const auto count = static_cast<double>(p_APs.size());
    for (std::size_t i = 0; i < p_APs.size(); ++i) {
      centre_A += p_APs[i] / count;
      centre_B += p_BPs[i] / count;
    }
    for (std::size_t i = 0; i < p_APs.size(); ++i)
      sigma += (p_APs[i] - centre_A) * (p_BPs[i] - centre_B).transpose() / count;
  }
};

/// Below this share of the largest singular value, a direction is rounding.
constexpr double kRounding = 1e-9;

Result<void> CheckCounts(std::size_t count_A, std::size_t count_B, std::size_t least) {
  if (count_A == count_B && count_A >= least) return {};
  return Error{ErrorKind::kInvalidInput,
               fmt::format("aligning: has {} and {} points, must have as many, and at least {}",
                           count_A,
                           count_B,
                           least)};
}

}  // namespace

Result<Pose2> AlignPoints(std::span<const Eigen::Vector2d> p_APs,
                          std::span<const Eigen::Vector2d> p_BPs) {
  if (auto ok = CheckCounts(p_APs.size(), p_BPs.size(), 2); !ok) return std::move(ok).error();
  const CrossCovariance<2> cross(p_APs, p_BPs);
  // The angle that maximises trace(R^T sigma).
  const double sine = cross.sigma(1, 0) - cross.sigma(0, 1);
  const double cosine = cross.sigma(0, 0) + cross.sigma(1, 1);
  if (!(std::hypot(sine, cosine) > 0.0)) {
    return Error{ErrorKind::kInvalidInput,
                 "aligning: the points are all in one place, must be in at least two"};
  }
  const Pose2 turn(0.0, 0.0, std::atan2(sine, cosine));
  const Eigen::Vector2d shift = cross.centre_A - turn * cross.centre_B;
  return Pose2(shift.x(), shift.y(), turn.yaw());
}

Result<Pose3> AlignPoints(std::span<const Eigen::Vector3d> p_APs,
                          std::span<const Eigen::Vector3d> p_BPs) {
  if (auto ok = CheckCounts(p_APs.size(), p_BPs.size(), 3); !ok) return std::move(ok).error();
  const CrossCovariance<3> cross(p_APs, p_BPs);
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(cross.sigma,
                                              Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Vector3d& values = svd.singularValues();
  if (!(values[1] > kRounding * values[0])) {
    return Error{ErrorKind::kInvalidInput,
                 "aligning: the points are all on one line, which leaves the turn about it open"};
  }
  // A mirror image is no rotation: turn the least certain axis round.
  const double sign = svd.matrixU().determinant() * svd.matrixV().determinant() < 0.0 ? -1.0 : 1.0;
  const Eigen::Matrix3d R_AB =
      svd.matrixU() * Eigen::Vector3d(1.0, 1.0, sign).asDiagonal() * svd.matrixV().transpose();
  return Pose3(R_AB, cross.centre_A - R_AB * cross.centre_B);
}

}  // namespace relocd
