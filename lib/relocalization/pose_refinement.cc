#include "relocalization/pose_refinement.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include <Eigen/Cholesky>

#include "relocalization/soft_inlier_score.h"

namespace relocd {
namespace {

/// What one pass over the correspondences adds up: the upper triangle of H = sum w J^T J row by
/// row, g = sum w J^T e, then sum w, sum (w e)^2 and the sum of the influence function's slope.
constexpr std::size_t kHessianTerms = 21;
constexpr std::size_t kGradient = kHessianTerms;
constexpr std::size_t kWeight = kGradient + 6;
constexpr std::size_t kSquaredInfluence = kWeight + 1;
constexpr std::size_t kInfluenceSlope = kSquaredInfluence + 1;
constexpr std::size_t kTerms = kInfluenceSlope + 1;
using Sums = std::array<double, kTerms>;

/// So many correspondences are added up in float before the sums go on in double.
constexpr std::size_t kBlock = 256;

/// The pose and the camera as floats.
struct View {
  std::array<float, 9> R{};
  std::array<float, 3> t{};
  float fx = 0.0F;
  float fy = 0.0F;
  float inverse_squared_threshold = 0.0F;
};

const FloatLanes& Lanes(const float* data) {
  return *reinterpret_cast<const FloatLanes*>(data);
}

/// Of kLanes correspondences: the residuals, their weights, and the derivatives of the residuals.
struct Linearised {
  FloatLanes eu;
  FloatLanes ev;
  FloatLanes ratio;  ///< Squared error over squared threshold.
  FloatLanes fade;   ///< 1 / (1 + ratio)
  FloatLanes w;
  FloatLanes u[6];  ///< d eu by the left perturbation (rho, omega) of X_CM.
  FloatLanes v[6];
};

[[gnu::always_inline]] inline void Linearise(const PackedCorrespondences& c,
                                             std::size_t i,
                                             const View& view,
                                             Linearised& l) {
  const FloatLanes zero{};
  const auto& [R, t, fx, fy, inverse_squared_threshold] = view;
  const FloatLanes px = Lanes(c.x() + i);
  const FloatLanes py = Lanes(c.y() + i);
  const FloatLanes pz = Lanes(c.z() + i);
  const FloatLanes depth = R[6] * px + R[7] * py + R[8] * pz + t[2];
  const auto in_front = depth > kMinDepth;
  const FloatLanes inverse_depth = in_front ? 1.0F / depth : zero;
  const FloatLanes x = (R[0] * px + R[1] * py + R[2] * pz + t[0]) * inverse_depth;
  const FloatLanes y = (R[3] * px + R[4] * py + R[5] * pz + t[1]) * inverse_depth;
  l.eu = fx * x - Lanes(c.u() + i);
  l.ev = fy * y - Lanes(c.v() + i);
  l.ratio = (l.eu * l.eu + l.ev * l.ev) * inverse_squared_threshold;
  l.fade = 1.0F / (1.0F + l.ratio);
  l.w = in_front ? l.fade * l.fade : zero;

  // A point moves by rho + omega x p_CP.
  l.u[0] = fx * inverse_depth;
  l.u[1] = zero;
  l.u[2] = -fx * x * inverse_depth;
  l.u[3] = -fx * x * y;
  l.u[4] = fx * (1.0F + x * x);
  l.u[5] = -fx * y;
  l.v[0] = zero;
  l.v[1] = fy * inverse_depth;
  l.v[2] = -fy * y * inverse_depth;
  l.v[3] = -fy * (1.0F + y * y);
  l.v[4] = fy * x * y;
  l.v[5] = fy * x;
}

/// The upper triangle of the weighted normal equations, row by row, and their right side.
[[gnu::always_inline]] inline void AddNormalEquations(const Linearised& l, FloatLanes* terms) {
  const FloatLanes weu = l.w * l.eu;
  const FloatLanes wev = l.w * l.ev;
  std::size_t term = 0;
  for (std::size_t row = 0; row < 6; ++row) {
    const FloatLanes wu = l.w * l.u[row];
    const FloatLanes wv = l.w * l.v[row];
    for (std::size_t column = row; column < 6; ++column)
      terms[term++] += wu * l.u[column] + wv * l.v[column];
    terms[kGradient + row] += l.u[row] * weu + l.v[row] * wev;
  }
  terms[kWeight] += l.w;
  terms[kSquaredInfluence] += weu * weu + wev * wev;
}

RELOCD_CLONE_FOR_AVX2
void AddBlock(const PackedCorrespondences& c,
              std::size_t begin,
              std::size_t end,
              const View& view,
              Sums& sums) {
  FloatLanes terms[kTerms] = {};
  for (std::size_t i = begin; i < end; i += kLanes) {
    Linearised l{};
    Linearise(c, i, view, l);
    AddNormalEquations(l, terms);
    // Half the divergence of w e: (1 - ratio) / (1 + ratio)^3.
    terms[kInfluenceSlope] += l.w * l.fade * (1.0F - l.ratio);
  }
  for (std::size_t term = 0; term < kTerms; ++term) {
    for (std::size_t lane = 0; lane < kLanes; ++lane)
      sums[term] += terms[term][lane];
  }
}

Sums AddAll(const PackedCorrespondences& c,
            std::size_t count,
            const CameraFromWorld& X_CM,
            double threshold_px) {
  View view{.fx = static_cast<float>(c.focal().x()),
            .fy = static_cast<float>(c.focal().y()),
            .inverse_squared_threshold = static_cast<float>(1.0 / (threshold_px * threshold_px))};
  for (Eigen::Index row = 0; row < 3; ++row) {
    view.t[static_cast<std::size_t>(row)] = static_cast<float>(X_CM.p_CW[row]);
    for (Eigen::Index column = 0; column < 3; ++column) {
      view.R[static_cast<std::size_t>(3 * row + column)] =
          static_cast<float>(X_CM.R_CW(row, column));
    }
  }
  Sums sums{};
  const std::size_t padded = c.PaddedSize(count);
  for (std::size_t begin = 0; begin < padded; begin += kBlock) {
    AddBlock(c, begin, std::min(begin + kBlock, padded), view, sums);
  }
  return sums;
}

Matrix6d HessianOf(const Sums& sums) {
  Matrix6d hessian;
  std::size_t term = 0;
  for (Eigen::Index row = 0; row < 6; ++row) {
    for (Eigen::Index column = row; column < 6; ++column) {
      hessian(row, column) = sums[term++];
      hessian(column, row) = hessian(row, column);
    }
  }
  return hessian;
}

/// A Hessian whose rows and columns were scaled to a unit diagonal, so that metres and radians
/// compare, and factored.
struct ScaledHessian {
  Vector6d scale;
  Eigen::LDLT<Matrix6d> factors;
};

std::optional<ScaledHessian> Factor(const Matrix6d& hessian) {
  // Points on a line, which leave a rotation free, give up to 2e-6 by rounding alone. The view
  // along a road gives 1e-2.
  constexpr double kMinPivot = 1e-5;
  if (!hessian.allFinite() || !(hessian.diagonal().minCoeff() > 0.0)) return std::nullopt;
  ScaledHessian scaled;
  scaled.scale = hessian.diagonal().cwiseSqrt().cwiseInverse();
  scaled.factors.compute(scaled.scale.asDiagonal() * hessian * scaled.scale.asDiagonal());
  if (!(scaled.factors.vectorD().minCoeff() > kMinPivot)) return std::nullopt;
  return scaled;
}

/// What the inverse Hessian has to be multiplied with to be the covariance; nothing when there are
/// too few inliers to say.
std::optional<double> ResidualVariance(const Sums& sums) {
  constexpr double kPointsOfAPose = 3.0;  // two equations each
  const double points = sums[kWeight];
  if (!(points > kPointsOfAPose + 1.0)) return std::nullopt;
  // Residuals that spread evenly beyond the threshold would make the slope vanish.
  const double slope = std::max(sums[kInfluenceSlope], 0.1 * points);
  return 0.5 * sums[kSquaredInfluence] * points / (slope * slope) * points /
         (points - kPointsOfAPose);
}

}  // namespace

RefinedPose RefinePose(const PackedCorrespondences& correspondences,
                       std::size_t count,
                       const CameraFromWorld& X_CM,
                       const RefinementSchedule& schedule) {
  RefinedPose refined{.X_CM = X_CM};
  const double shrink = schedule.end_threshold_px / schedule.start_threshold_px;
  for (int step = 0; step < schedule.steps; ++step) {
    // The last third of the steps is at the final threshold, to converge there.
    const double progress = std::min(1.0, 1.5 * step / schedule.steps);
    const Sums sums = AddAll(correspondences,
                             count,
                             refined.X_CM,
                             schedule.start_threshold_px * std::pow(shrink, progress));
    const std::optional<ScaledHessian> scaled = Factor(HessianOf(sums));
    if (!scaled) {
      refined.degenerate = true;
      return refined;
    }
    const Vector6d gradient = Eigen::Map<const Vector6d>(sums.data() + kGradient);
    const Vector6d delta =
        -scaled->scale.cwiseProduct(scaled->factors.solve(scaled->scale.cwiseProduct(gradient)));
    const Pose3 moved = Pose3::Exp(delta);
    refined.X_CM.R_CW = moved.R() * refined.X_CM.R_CW;
    refined.X_CM.p_CW = moved * refined.X_CM.p_CW;
  }

  const Sums sums = AddAll(correspondences, count, refined.X_CM, schedule.end_threshold_px);
  const std::optional<ScaledHessian> scaled = Factor(HessianOf(sums));
  const std::optional<double> variance = ResidualVariance(sums);
  if (!scaled || !variance) {
    refined.degenerate = true;
    return refined;
  }
  const Matrix6d inverse = scaled->factors.solve(Matrix6d::Identity());
  refined.covariance =
      *variance * (scaled->scale.asDiagonal() * inverse * scaled->scale.asDiagonal());
  refined.covariance = 0.5 * (refined.covariance + refined.covariance.transpose()).eval();
  return refined;
}

}  // namespace relocd
