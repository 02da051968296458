#include "relocalization/soft_inlier_score.h"

#include <array>
#include <cmath>

namespace relocd {
namespace {

/// The rows of the 3x4 matrix that maps (p_MP, 1) to (fx X, fy Y, Z).
std::array<float, 12> ProjectionMatrix(const CameraFromWorld& X_CM, const Eigen::Vector2d& focal) {
  const Eigen::Vector3d scale(focal.x(), focal.y(), 1.0);
  std::array<float, 12> projection{};
  for (Eigen::Index row = 0; row < 3; ++row) {
    for (Eigen::Index column = 0; column < 4; ++column) {
      const double value = column < 3 ? X_CM.R_CW(row, column) : X_CM.p_CW[row];
      projection[static_cast<std::size_t>(4 * row + column)] =
          static_cast<float>(scale[row] * value);
    }
  }
  return projection;
}

const FloatLanes& Lanes(const float* data) {
  return *reinterpret_cast<const FloatLanes*>(data);
}

RELOCD_CLONE_FOR_AVX2
void AddScores(const PackedCorrespondences& c,
               std::size_t count,
               const std::array<float, 12>& projection,
               float inverse_squared_threshold,
               std::array<float, kLanes>& score) {
  FloatLanes sum{};
  const FloatLanes zero{};
  for (std::size_t i = 0; i < count; i += kLanes) {
    const FloatLanes x = Lanes(c.x() + i);
    const FloatLanes y = Lanes(c.y() + i);
    const FloatLanes z = Lanes(c.z() + i);
    const FloatLanes depth =
        projection[8] * x + projection[9] * y + projection[10] * z + projection[11];
    const FloatLanes inverse_depth = 1.0F / depth;
    const FloatLanes du =
        (projection[0] * x + projection[1] * y + projection[2] * z + projection[3]) *
            inverse_depth -
        Lanes(c.u() + i);
    const FloatLanes dv =
        (projection[4] * x + projection[5] * y + projection[6] * z + projection[7]) *
            inverse_depth -
        Lanes(c.v() + i);
    const FloatLanes ratio = (du * du + dv * dv) * inverse_squared_threshold;
    const FloatLanes soft_inlier = 1.0F / (1.0F + ratio * ratio);
    sum += depth > kMinDepth ? soft_inlier : zero;
  }
  for (std::size_t lane = 0; lane < kLanes; ++lane)
    score[lane] = sum[lane];
}

}  // namespace

double SoftInlierScore(const PackedCorrespondences& correspondences,
                       std::size_t count,
                       const CameraFromWorld& X_CM,
                       double threshold_px) {
  std::array<float, kLanes> lanes{};
  AddScores(correspondences,
            correspondences.PaddedSize(count),
            ProjectionMatrix(X_CM, correspondences.focal()),
            static_cast<float>(1.0 / (threshold_px * threshold_px)),
            lanes);
  double score = 0.0;
  for (const float lane : lanes)
    score += lane;
  return score;
}

InlierCount CountInliers(const PackedCorrespondences& correspondences,
                         const CameraFromWorld& X_CM,
                         double threshold_px) {
  InlierCount count;
  double squares = 0.0;
  for (std::size_t i = 0; i < correspondences.size(); ++i) {
    const Eigen::Vector3d p_CP = X_CM * correspondences.p_MP(i);
    if (p_CP.z() < kMinDepth) continue;
    const Eigen::Vector2d projected =
        correspondences.focal().cwiseProduct(p_CP.head<2>()) / p_CP.z();
    const double square = (projected - correspondences.pixel(i)).squaredNorm();
    if (!(square < threshold_px * threshold_px)) continue;
    ++count.inliers;
    squares += square;
  }
  if (count.inliers > 0) count.rms_px = std::sqrt(squares / static_cast<double>(count.inliers));
  return count;
}

}  // namespace relocd
