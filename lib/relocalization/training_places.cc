#include "relocalization/training_places.h"

#include <cmath>
#include <numbers>

namespace relocd {

NearestPlace FindNearestPlace(const MapRegion& region, const Pose3& X_WC, double max_turn_rad) {
  const Eigen::Vector3d forward_W = X_WC.R().col(2);
  const double heading_rad = std::atan2(forward_W.y(), forward_W.x());
  NearestPlace nearest;
  for (const TrainingPose& pose : region.training_poses) {
    const double turn_rad = std::remainder(pose.heading_rad - heading_rad, 2.0 * std::numbers::pi);
    const double distance_m = (pose.p_WC.cast<double>() - X_WC.translation()).head<2>().norm();
    if (std::abs(turn_rad) > max_turn_rad || distance_m >= nearest.distance_m) continue;
    nearest = {distance_m, pose.p_WC.z()};
  }
  return nearest;
}

bool IsNearTraining(const MapRegion& region, const Pose3& X_WC) {
  constexpr double kReachM = 25.0;
  constexpr double kMaxHeightM = 10.0;
  constexpr double kMaxTurnRad = 0.5 * std::numbers::pi;
  if (region.training_poses.empty()) return true;  // the map does not say
  const NearestPlace nearest = FindNearestPlace(region, X_WC, kMaxTurnRad);
  return nearest.distance_m < kReachM &&
         std::abs(nearest.height_m - X_WC.translation().z()) < kMaxHeightM;
}

}  // namespace relocd
