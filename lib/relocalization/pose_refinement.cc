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

RELOCD_CLONE_FOR_AVX2
void AddBlock(const PackedCorrespondences& c,
              std::size_t begin,
              std::size_t end,
              const View& view,
              Sums& sums) {
  FloatLanes terms[kTerms] = {};
  const FloatLanes zero{};
  const auto& [R, t, fx, fy, inverse_squared_threshold] = view;
  for (std::size_t i = begin; i < end; i += kLanes) {
    const FloatLanes px = Lanes(c.x() + i);
    const FloatLanes py = Lanes(c.y() + i);
    const FloatLanes pz = Lanes(c.z() + i);
    const FloatLanes depth = R[6] * px + R[7] * py + R[8] * pz + t[2];
    const auto in_front = depth > kMinDepth_m;
    const FloatLanes inverse_depth = in_front ? 1.0F / depth : zero;
    const FloatLanes x = (R[0] * px + R[1] * py + R[2] * pz + t[0]) * inverse_depth;
    const FloatLanes y = (R[3] * px + R[4] * py + R[5] * pz + t[1]) * inverse_depth;
    const FloatLanes eu = fx * x - Lanes(c.u() + i);
    const FloatLanes ev = fy * y - Lanes(c.v() + i);

    const FloatLanes ratio = (eu * eu + ev * ev) * inverse_squared_threshold;
    const FloatLanes fade = 1.0F / (1.0F + ratio);
    const FloatLanes w = in_front ? fade * fade : zero;
    const FloatLanes weu = w * eu;
    const FloatLanes wev = w * ev;

    // A point moves by rho + omega x p_CP under the left perturbation (rho, omega) of X_CM.
    const FloatLanes u[6] = {fx * inverse_depth,
                             zero,
                             -fx * x * inverse_depth,
                             -fx * x * y,
                             fx * (1.0F + x * x),
                             -fx * y};
    const FloatLanes v[6] = {zero,
                             fy * inverse_depth,
                             -fy * y * inverse_depth,
                             -fy * (1.0F + y * y),
                             fy * x * y,
                             fy * x};
    std::size_t term = 0;
    for (std::size_t row = 0; row < 6; ++row) {
      const FloatLanes wu = w * u[row];
      const FloatLanes wv = w * v[row];
      for (std::size_t column = row; column < 6; ++column) {
        terms[term++] += wu * u[column] + wv * v[column];
      }
      terms[kGradient + row] += u[row] * weu + v[row] * wev;
    }
    terms[kWeight] += w;
    terms[kSquaredInfluence] += weu * weu + wev * wev;
    // Half the divergence of w e: (1 - r) / (1 + r)^3 for r = (e / threshold)^2.
    terms[kInfluenceSlope] += w * fade * (1.0F - ratio);
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
  Matrix6d H;
  std::size_t term = 0;
  for (Eigen::Index row = 0; row < 6; ++row) {
    for (Eigen::Index column = row; column < 6; ++column) {
      H(row, column) = sums[term++];
      H(column, row) = H(row, column);
    }
  }
  return H;
}

/// A Hessian whose rows and columns were scaled to a unit diagonal, so that metres and radians
/// compare, and factored.
struct ScaledHessian {
  Vector6d scale;
  Eigen::LDLT<Matrix6d> factors;
};

std::optional<ScaledHessian> Factor(const Matrix6d& H) {
  // Points on a line, which leave a rotation free, give up to 2e-6 by rounding alone. The view
  // along a road gives 1e-2.
  constexpr double kMinPivot = 1e-5;
  if (!H.allFinite() || !(H.diagonal().minCoeff() > 0.0)) return std::nullopt;
  ScaledHessian scaled;
  scaled.scale = H.diagonal().cwiseSqrt().cwiseInverse();
  scaled.factors.compute(scaled.scale.asDiagonal() * H * scaled.scale.asDiagonal());
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
