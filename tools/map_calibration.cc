#include "map_calibration.h"

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <utility>

#include "geometry/covariance.h"
#include "map_disturbance.h"
#include "map_evaluation.h"

namespace relocd {
namespace {

/// A pose that is off by less is right.
constexpr double kRightM = 2.0;
constexpr std::size_t kMirroredFrames = 200;

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

/// Well above what mirrored images reach, and well below what right poses have; where both are near
/// to each other, above the mirrored ones, as long as hardly a right pose is refused.
double ConfidenceThreshold(const std::vector<double>& right, const std::vector<double>& mirrored) {
  constexpr double kLeast = 0.03;
  constexpr double kRefusedShare = 0.01;
  const double wrong =
      mirrored.empty() ? kLeast : *std::max_element(mirrored.begin(), mirrored.end());
  const double lowest_right = right.empty() ? 1.0 : Quantile(right, kRefusedShare);
  const double between = std::max(1.1 * wrong, std::min(2.0 * wrong, 0.5 * lowest_right));
  return std::clamp(std::min(between, lowest_right), kLeast, 1.0);
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

/// The confidences of the poses that one region alone finds in mirrored images.
Result<std::vector<double>> MirroredConfidences(const SceneMap& map,
                                                std::size_t region,
                                                const std::vector<DatasetFrame>& frames,
                                                int threads) {
  SceneMap alone = map;
  alone.regions = {map.regions[region]};
  const auto mirror = [](const GrayImage& image, int /*index*/) { return Mirror(image); };
  const auto found = LocalizeFrames(alone, frames, threads, mirror);
  if (!found) return found.error();
  return Confidences(*found);
}

std::vector<DatasetFrame> EvenlySpaced(const std::vector<DatasetFrame>& frames, std::size_t count) {
  std::vector<DatasetFrame> chosen;
  const std::size_t size = std::min(count, frames.size());
  for (std::size_t index = 0; index < size; ++index)
    chosen.push_back(frames[index * frames.size() / size]);
  return chosen;
}

}  // namespace

Result<void> CalibrateRegions(const std::vector<DatasetFrame>& held_out,
                              int threads,
                              SceneMap& map) {
  for (MapRegion& region : map.regions)
    region.calibration = {};  // covariances as they come, and no pose refused
  const auto raw = LocalizeFrames(map, held_out, threads);
  if (!raw) return raw.error();
  const std::vector<DatasetFrame> foreign = EvenlySpaced(held_out, kMirroredFrames);
  std::vector<RegionCalibration> calibrations(map.regions.size());
  for (std::size_t region = 0; region < map.regions.size(); ++region) {
    std::vector<FrameLocalization> localizations = OfRegion(*raw, region);
    const auto mirrored = MirroredConfidences(map, region, foreign, threads);
    if (!mirrored) return mirrored.error();
    calibrations[region].covariance_factor = CovarianceFactor(map, localizations);
    std::erase_if(localizations, [&map](const FrameLocalization& localization) {
      return PoseError(map, localization).head<3>().norm() > kRightM;
    });
    calibrations[region].confidence_threshold =
        ConfidenceThreshold(Confidences(localizations), *mirrored);
  }
  for (std::size_t region = 0; region < map.regions.size(); ++region)
    map.regions[region].calibration = calibrations[region];
  return {};
}

}  // namespace relocd
