#include "map_evaluation.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <utility>

#include "camera/jpeg.h"
#include "core/file.h"
#include "geometry/covariance.h"

namespace relocd {
namespace {

Pose3 TruthInMap(const SceneMap& map, const DatasetFrame& frame) {
  return Pose3(map.R_WD, Eigen::Vector3d::Zero()) * frame.X_WC;
}

/// Tries all regions on the image that the predictor has extracted.
void LocalizeInRegions(const SceneMap& map,
                       const std::vector<RegionCalibration>& calibrations,
                       SceneCoordinatePredictor& predictor,
                       FrameLocalization& result) {
  const PinholeCamera camera(map.camera);
  std::vector<Correspondence> correspondences;
  for (std::size_t region = 0; region < map.regions.size(); ++region) {
    correspondences.clear();
    for (const ScenePrediction& prediction : predictor.Predict(region)) {
      correspondences.push_back({prediction.pixel, prediction.p_WP});
    }
    const RegionCalibration& calibration =
        calibrations.empty() ? map.regions[region].calibration : calibrations[region];
    const auto seed = static_cast<std::uint64_t>(result.frame.index);
    CameraPoseResult pose = EstimateCameraPose(
        correspondences, camera, PoseOptionsFor(calibration), std::nullopt, seed);
    const bool is_better =
        (pose.status == CameraPoseStatus::kOk) > (result.pose.status == CameraPoseStatus::kOk) ||
        ((pose.status == CameraPoseStatus::kOk) == (result.pose.status == CameraPoseStatus::kOk) &&
         pose.confidence > result.pose.confidence);
    if (region == 0 || is_better) {
      result.pose = std::move(pose);
      result.region = region;
    }
  }
}

}  // namespace

CameraPoseOptions PoseOptionsFor(const RegionCalibration& calibration) {
  CameraPoseOptions options;
  options.calibration = {.covariance_scale = calibration.covariance_factor,
                         .translation_floor_sigma_m = calibration.sigma_floor_m,
                         .rotation_floor_sigma_rad = calibration.sigma_floor_rad,
                         .min_confidence = calibration.confidence_threshold};
  return options;
}

Result<std::vector<FrameLocalization>> LocalizeFrames(
    const SceneMap& map,
    const std::vector<DatasetFrame>& frames,
    const std::vector<RegionCalibration>& calibrations,
    int threads) {
  auto predictor = SceneCoordinatePredictor::Create(map, threads);
  if (!predictor) return std::move(predictor).error();
  std::vector<FrameLocalization> results;
  for (const DatasetFrame& frame : frames) {
    const auto bytes = ReadFile(frame.image_path);
    if (!bytes) return bytes.error();
    const auto start = std::chrono::steady_clock::now();
    const auto image = DecodeJpegToGray(AsBytes(*bytes));
    if (!image) return Error(image.error()).WithContext(frame.image_path);
    if (auto extracted = (*predictor)->Extract(*image); !extracted) {
      return Error(extracted.error()).WithContext(frame.image_path);
    }
    FrameLocalization result;
    result.frame = frame;
    LocalizeInRegions(map, calibrations, **predictor, result);
    const auto elapsed = std::chrono::steady_clock::now() - start;
    result.milliseconds = std::chrono::duration<double, std::milli>(elapsed).count();
    results.push_back(std::move(result));
  }
  return results;
}

Vector6d PoseError(const SceneMap& map, const FrameLocalization& localization) {
  return (localization.pose.X_WC.Inverse() * TruthInMap(map, localization.frame)).Log();
}

double Quantile(std::vector<double> values, double share) {
  const auto last = static_cast<double>(values.size() - 1);
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(std::lround(share * last));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

PoseErrors MeasureErrors(const SceneMap& map, const std::vector<FrameLocalization>& localizations) {
  PoseErrors errors;
  errors.frames = localizations.size();
  std::vector<double> metres;
  std::vector<double> radians;
  std::vector<double> milliseconds;
  std::size_t near = 0;
  std::size_t inside = 0;
  for (const FrameLocalization& localization : localizations) {
    milliseconds.push_back(localization.milliseconds);
    if (localization.pose.status != CameraPoseStatus::kOk) continue;
    const Pose3 X_WC_true = TruthInMap(map, localization.frame);
    const Pose3& X_WC = localization.pose.X_WC;
    metres.push_back((X_WC.translation() - X_WC_true.translation()).norm());
    radians.push_back(AngleBetween(X_WC.rotation(), X_WC_true.rotation()));
    if (metres.back() < 1.0) ++near;
    const double distance =
        SquaredMahalanobis(PoseError(map, localization), localization.pose.covariance);
    if (distance < kChiSquared95Dof6) ++inside;
  }
  errors.localized = metres.size();
  if (!milliseconds.empty()) {
    errors.median_ms = Quantile(milliseconds, 0.5);
    errors.p99_ms = Quantile(milliseconds, 0.99);
  }
  if (metres.empty()) return errors;
  errors.median_m = Quantile(metres, 0.5);
  errors.p95_m = Quantile(metres, 0.95);
  errors.median_rad = Quantile(radians, 0.5);
  errors.within_1m = static_cast<double>(near) / static_cast<double>(errors.frames);
  errors.within_95 = static_cast<double>(inside) / static_cast<double>(errors.localized);
  return errors;
}

}  // namespace relocd
