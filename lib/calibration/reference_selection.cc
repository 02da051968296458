#include "calibration/reference_selection.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include <Eigen/Core>

#include "geometry/trajectory.h"

namespace relocd {
namespace {

/// A pose is compared with so many before it, and as many behind it.
constexpr std::size_t kNeighbours = 10;
/// What odometry may be off by as part of the way, and by what the reference's mounting moves in a
/// bend.
constexpr double kOdometryPart = 0.1;
constexpr double kLeverM = 1.0;
/// Of errors of the reference itself.
constexpr double kMaxDeviation = 4.0;

/// A pose that is compared.
struct Compared {
  ReferencePose pose{};
  Eigen::Vector2d p_OB_m = Eigen::Vector2d::Zero();  ///< By odometry.
};

std::vector<Compared> Thin(const OdometryRecording& recording,
                           const std::vector<ReferencePose>& references,
                           double spacing_s) {
  std::vector<Compared> thinned;
  for (const ReferencePose& reference : references) {
    const bool is_near =
        !thinned.empty() && reference.time_s < thinned.back().pose.time_s + spacing_s;
    if (is_near && &reference != &references.back()) continue;
    const auto time_ns = recording.origin_ns + std::llround(1e9 * reference.time_s);
    const auto X_OB =
        Interpolate(recording.X_OBs, time_ns, std::numeric_limits<std::int64_t>::max());
    if (X_OB) thinned.push_back({.pose = reference, .p_OB_m = X_OB->translation()});
  }
  return thinned;
}

/// By how much more than odometry is off the reference has two poses nearer to or further from each
/// other.
double Disagreement(const Compared& a, const Compared& b) {
  const double odometry_m = (a.p_OB_m - b.p_OB_m).norm();
  const double reference_m = (a.pose.X_WR.translation() - b.pose.X_WR.translation()).norm();
  return std::max(std::abs(reference_m - odometry_m) - kOdometryPart * odometry_m - kLeverM, 0.0);
}

/// The standard deviation of a distance between two poses of the reference, if up to half of the
/// poses are off: a quarter of the pairs is of two that are not.
double TypicalDisagreement(const std::vector<Compared>& compared) {
  std::vector<double> disagreements;
  for (std::size_t i = 0; i + 1 < compared.size(); ++i)
    disagreements.push_back(Disagreement(compared[i], compared[i + 1]));
  if (disagreements.empty()) return 0.0;
  constexpr double kQuartile = 0.3186;  // of a normal distribution's magnitude
  const auto quarter =
      disagreements.begin() + static_cast<std::ptrdiff_t>(disagreements.size() / 4);
  std::nth_element(disagreements.begin(), quarter, disagreements.end());
  return *quarter / kQuartile;
}

}  // namespace

ReferenceSelection SelectReferences(const OdometryRecording& recording,
                                    const std::vector<ReferencePose>& references,
                                    double spacing_s) {
  const std::vector<Compared> compared = Thin(recording, references, spacing_s);
  const double allowed_m = kMaxDeviation * TypicalDisagreement(compared);
  ReferenceSelection selection;
  for (std::size_t i = 0; i < compared.size(); ++i) {
    const std::size_t begin = i - std::min(i, kNeighbours);
    const std::size_t end = std::min(i + kNeighbours + 1, compared.size());
    std::size_t agreeing = 0;
    for (std::size_t k = begin; k < end; ++k)
      agreeing += k != i && Disagreement(compared[i], compared[k]) <= allowed_m ? 1 : 0;
    if (2 * agreeing + 1 >= end - begin) {
      selection.poses.push_back(compared[i].pose);
    } else {
      ++selection.disagreeing;
    }
  }
  return selection;
}

}  // namespace relocd
