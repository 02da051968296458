#include "map_calibration.h"

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <numbers>
#include <utility>

#include "geometry/covariance.h"
#include "map_disturbance.h"
#include "map_evaluation.h"
#include "relocalization/training_places.h"

namespace relocd {
namespace {

/// A pose that is off by less is right.
constexpr double kRightM = 2.0;
/// Frames that are looked for by each region for wrong poses.
constexpr std::size_t kWrongFrames = 200;

/// The factor by which covariances must grow.
double CovarianceFactor(const SceneMap& map, const std::vector<FrameLocalization>& localizations) {
  // Errors of neighbouring frames on the same stretch are alike, so that few frames say less than
  // they seem to: the factor is taken where nine of ten frames are inside their 90 % region.
  constexpr double kShare = 0.9;
  constexpr double kChiSquared90Dof6 = 10.644640675668422;
  std::vector<double> ratios;
  for (const FrameLocalization& localization : localizations) {
    const Vector6d error = PoseError(map, localization);
    ratios.push_back(SquaredMahalanobis(error, localization.pose.covariance) / kChiSquared90Dof6);
  }
  return ratios.empty() ? 1.0 : std::clamp(Quantile(ratios, kShare), 1.0, 1e6);
}

std::vector<FrameLocalization> OfRegion(const std::vector<FrameLocalization>& localizations,
                                        std::size_t region) {
  std::vector<FrameLocalization> chosen;
  std::copy_if(localizations.begin(),
               localizations.end(),
               std::back_inserter(chosen),
               [region](const FrameLocalization& localization) {
                 return localization.pose.status == CameraPoseStatus::kOk &&
                        localization.region == region;
               });
  return chosen;
}

std::vector<double> Confidences(const std::vector<FrameLocalization>& localizations) {
  std::vector<double> confidences;
  for (const FrameLocalization& localization : localizations) {
    if (localization.pose.status != CameraPoseStatus::kOk) continue;
    confidences.push_back(localization.pose.confidence);
  }
  return confidences;
}

/// The confidences of the poses that one region alone finds where there are none to find.
Result<std::vector<double>> WrongConfidences(const SceneMap& map,
                                             std::size_t region,
                                             const std::vector<DatasetFrame>& frames,
                                             int threads) {
  SceneMap alone = map;
  alone.regions = {map.regions[region]};
  const auto foreign = LocalizeFrames(alone, FramesBeyondReach(map, region, frames), threads);
  if (!foreign) return foreign.error();
  const auto mirror = [](const GrayImage& image, int /*index*/) { return Mirror(image); };
  const auto mirrored = LocalizeFrames(alone, frames, threads, mirror);
  if (!mirrored) return mirrored.error();
  std::vector<double> wrong = Confidences(*foreign);
  const std::vector<double> of_mirrored = Confidences(*mirrored);
  wrong.insert(wrong.end(), of_mirrored.begin(), of_mirrored.end());
  return wrong;
}

std::vector<DatasetFrame> HeldOut(const std::vector<RouteFrame>& route) {
  std::vector<DatasetFrame> frames;
  for (const RouteFrame& frame : route) {
    if (frame.is_held_out) frames.push_back(frame.frame);
  }
  return frames;
}

std::vector<DatasetFrame> EvenlySpaced(const std::vector<RouteFrame>& route, std::size_t count) {
  std::vector<DatasetFrame> chosen;
  const std::size_t size = std::min(count, route.size());
  for (std::size_t index = 0; index < size; ++index)
    chosen.push_back(route[index * route.size() / size].frame);
  return chosen;
}

}  // namespace

double ConfidenceThreshold(const std::vector<double>& right, const std::vector<double>& wrong) {
  constexpr double kLeast = 0.03;
  constexpr double kRefusedShare = 0.01;
  // Streets that the map has never seen reach up to 2.5 times what mirrored frames of a short one
  // do.
  constexpr double kUnseenFactor = 3.0;
  const double highest_wrong =
      wrong.empty() ? kLeast : *std::max_element(wrong.begin(), wrong.end());
  const double lowest_right = right.empty() ? 1.0 : Quantile(right, kRefusedShare);
  const double between =
      std::max(1.1 * highest_wrong, std::min(kUnseenFactor * highest_wrong, 0.5 * lowest_right));
  return std::clamp(std::min(between, lowest_right), kLeast, 1.0);
}

std::vector<DatasetFrame> FramesBeyondReach(const SceneMap& map,
                                            std::size_t region,
                                            const std::vector<DatasetFrame>& frames) {
  constexpr double kReachM = 50.0;
  const Pose3 X_WD(map.R_WD, Eigen::Vector3d::Zero());
  std::vector<DatasetFrame> beyond;
  std::copy_if(
      frames.begin(), frames.end(), std::back_inserter(beyond), [&](const DatasetFrame& frame) {
        const NearestPlace nearest =
            FindNearestPlace(map.regions[region], X_WD * frame.X_WC, std::numbers::pi);
        return nearest.distance_m > kReachM;
      });
  return beyond;
}

Result<void> CalibrateRegions(const std::vector<RouteFrame>& route, int threads, SceneMap& map) {
  for (MapRegion& region : map.regions)
    region.calibration = {};  // covariances as they come, and no pose refused
  const auto held_out = LocalizeFrames(map, HeldOut(route), threads);
  if (!held_out) return held_out.error();
  const std::vector<DatasetFrame> sample = EvenlySpaced(route, kWrongFrames);
  std::vector<RegionCalibration> calibrations(map.regions.size());
  for (std::size_t region = 0; region < map.regions.size(); ++region) {
    std::vector<FrameLocalization> localizations = OfRegion(*held_out, region);
    const auto wrong = WrongConfidences(map, region, sample, threads);
    if (!wrong) return wrong.error();
    calibrations[region].covariance_factor = CovarianceFactor(map, localizations);
    std::erase_if(localizations, [&map](const FrameLocalization& localization) {
      return PoseError(map, localization).head<3>().norm() > kRightM;
    });
    calibrations[region].confidence_threshold =
        ConfidenceThreshold(Confidences(localizations), *wrong);
  }
  for (std::size_t region = 0; region < map.regions.size(); ++region)
    map.regions[region].calibration = calibrations[region];
  return {};
}

}  // namespace relocd
