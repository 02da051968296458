#include "relocalization/map_localizer.h"

#include <cmath>
#include <numbers>
#include <span>
#include <utility>

#include "relocalization/training_places.h"

namespace relocd {
namespace {

PoseCalibration CalibrationOf(const RegionCalibration& region) {
  return {.covariance_scale = region.covariance_factor,
          .translation_floor_sigma_m = region.sigma_floor_m,
          .rotation_floor_sigma_rad = region.sigma_floor_rad,
          .min_confidence = region.confidence_threshold};
}

/// A wrong pose comes out where the camera is expected by a rare chance only, so that one which
/// does is believed with this share of the support that it needs elsewhere.
constexpr double kExpectedShare = 0.65;

bool IsWhereExpected(const Pose3& X_WC, const std::optional<Pose3>& expected_WC) {
  constexpr double kReachM = 2.0;
  constexpr double kReachRad = 0.1;
  if (!expected_WC) return false;
  const Pose3 difference = expected_WC->Inverse() * X_WC;
  return difference.translation().norm() < kReachM &&
         AngleBetween(expected_WC->rotation(), X_WC.rotation()) < kReachRad;
}

/// A pose before none, and more support before less.
bool IsBetterPose(const CameraPoseResult& a, const CameraPoseResult& b) {
  const bool a_ok = a.status == CameraPoseStatus::kOk;
  const bool b_ok = b.status == CameraPoseStatus::kOk;
  return a_ok != b_ok ? a_ok : a.confidence > b.confidence;
}

}  // namespace

MapLocalizer::MapLocalizer(SceneMap map, const InferenceConfig& config)
    : map_(std::move(map)),
      camera_(map_.camera),
      options_(config.pose),
      selector_(map_.regions, static_cast<std::size_t>(config.regions_per_image)) {}

Result<std::unique_ptr<MapLocalizer>> MapLocalizer::Create(SceneMap map,
                                                           const InferenceConfig& config,
                                                           const Progress& progress) {
  std::unique_ptr<MapLocalizer> localizer(new MapLocalizer(std::move(map), config));
  auto predictor = SceneCoordinatePredictor::Create(localizer->map_, config.threads, progress);
  if (!predictor) return std::move(predictor).error();
  localizer->predictor_ = std::move(*predictor);
  return localizer;
}

Result<std::unique_ptr<MapLocalizer>> MapLocalizer::Load(const InferenceConfig& config,
                                                         const Progress& progress) {
  if (config.map_path.empty()) {
    return Error{ErrorKind::kInvalidInput,
                 "map_path is empty, must name a map (`reloc map train` makes one)"};
  }
  auto map = ReadMap(config.map_path, progress);
  if (!map) return std::move(map).error();
  return Create(std::move(*map), config, progress);
}

Pose3 MapLocalizer::AtTrainedHeight(const Pose3& X_WC) const {
  NearestPlace nearest;
  for (const MapRegion& region : map_.regions) {
    const NearestPlace of_region = FindNearestPlace(region, X_WC, std::numbers::pi);
    if (of_region.distance_m < nearest.distance_m) nearest = of_region;
  }
  if (std::isinf(nearest.distance_m)) return X_WC;
  return {X_WC.rotation(), {X_WC.translation().x(), X_WC.translation().y(), nearest.height_m}};
}

void MapLocalizer::TryRegion(std::size_t region,
                             const std::optional<Pose3>& prior,
                             std::uint64_t seed,
                             const Clock& clock,
                             ImageLocalization& localization) {
  const MonotonicTime start = clock();
  const std::span<const ScenePrediction> predictions = predictor_->Predict(region);
  const MonotonicTime predicted = clock();
  correspondences_.clear();
  for (const ScenePrediction& prediction : predictions) {
    correspondences_.push_back(
        {.pixel = prediction.pixel, .p_WP = prediction.p_WP, .confidence = prediction.confidence});
  }
  CameraPoseOptions options = options_;
  options.calibration = CalibrationOf(map_.regions[region].calibration);
  const double min_confidence = options.calibration.min_confidence;
  if (prior) options.calibration.min_confidence *= kExpectedShare;
  CameraPoseResult pose = EstimateCameraPose(correspondences_, camera_, options, prior, seed);
  if (pose.status == CameraPoseStatus::kOk && pose.confidence < min_confidence &&
      !IsWhereExpected(pose.X_WC, prior)) {
    pose.status = CameraPoseStatus::kLowConfidence;
  }
  if (pose.status == CameraPoseStatus::kOk && !IsNearTraining(map_.regions[region], pose.X_WC)) {
    pose.status = CameraPoseStatus::kOffRoute;
  }
  localization.head_time += predicted - start;
  localization.pose_time += clock() - predicted;
  ++localization.regions_tried;
  if (localization.regions_tried > 1 && !IsBetterPose(pose, localization.pose)) return;
  localization.pose = pose;
  localization.region = pose.status == CameraPoseStatus::kOk ? static_cast<int>(region) : -1;
}

Result<ImageLocalization> MapLocalizer::Localize(const GrayImage& image,
                                                 const std::optional<CameraPrior>& prior,
                                                 std::uint64_t seed,
                                                 const Clock& clock) {
  ImageLocalization localization;
  const MonotonicTime start = clock();
  if (auto ok = predictor_->Extract(image); !ok) return std::move(ok).error();
  localization.features_time = clock() - start;
  const std::optional<Pose3> X_WC =
      prior ? std::optional(AtTrainedHeight(prior->X_WC)) : std::nullopt;
  for (const std::size_t region : selector_.Choose(prior))
    TryRegion(region, X_WC, seed, clock, localization);
  selector_.Report(localization.region < 0
                       ? std::nullopt
                       : std::optional(static_cast<std::size_t>(localization.region)));
  return localization;
}

Result<ImageLocalization> MapLocalizer::LocalizeAnywhere(const GrayImage& image,
                                                         std::uint64_t seed) {
  ImageLocalization localization;
  if (auto ok = predictor_->Extract(image); !ok) return std::move(ok).error();
  const auto no_clock = [] { return MonotonicTime{}; };
  for (std::size_t region = 0; region < map_.regions.size(); ++region)
    TryRegion(region, std::nullopt, seed, no_clock, localization);
  return localization;
}

}  // namespace relocd
