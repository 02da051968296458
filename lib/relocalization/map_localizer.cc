#include "relocalization/map_localizer.h"

#include <algorithm>
#include <numeric>
#include <span>
#include <utility>

namespace relocd {
namespace {

PoseCalibration CalibrationOf(const RegionCalibration& region) {
  return {.covariance_scale = region.covariance_factor,
          .translation_floor_sigma_m = region.sigma_floor_m,
          .rotation_floor_sigma_rad = region.sigma_floor_rad,
          .min_confidence = region.confidence_threshold};
}

/// A pose before none, and more support before less.
bool IsBetterPose(const CameraPoseResult& a, const CameraPoseResult& b) {
  const bool a_ok = a.status == CameraPoseStatus::kOk;
  const bool b_ok = b.status == CameraPoseStatus::kOk;
  return a_ok != b_ok ? a_ok : a.confidence > b.confidence;
}

}  // namespace

MapLocalizer::MapLocalizer(SceneMap map, const CameraPoseOptions& options)
    : map_(std::move(map)), camera_(map_.camera), options_(options) {}

Result<std::unique_ptr<MapLocalizer>> MapLocalizer::Create(SceneMap map,
                                                           const CameraPoseOptions& options,
                                                           int threads) {
  std::unique_ptr<MapLocalizer> localizer(new MapLocalizer(std::move(map), options));
  auto predictor = SceneCoordinatePredictor::Create(localizer->map_, threads);
  if (!predictor) return std::move(predictor).error();
  localizer->predictor_ = std::move(*predictor);
  return localizer;
}

Result<std::unique_ptr<MapLocalizer>> MapLocalizer::Load(const std::string& path,
                                                         const CameraPoseOptions& options,
                                                         int threads) {
  if (path.empty()) {
    return Error{ErrorKind::kInvalidInput,
                 "map_path is empty, must name a map (`reloc map train` makes one)"};
  }
  auto map = ReadMap(path);
  if (!map) return std::move(map).error();
  return Create(std::move(*map), options, threads);
}

std::vector<std::size_t> MapLocalizer::RegionsToTry() const {
  const std::size_t count = map_.regions.size();
  const std::size_t first =
      last_region_ ? *last_region_ - std::min<std::size_t>(*last_region_, 1) : 0;
  const std::size_t end = last_region_ ? std::min(count, *last_region_ + 2) : count;
  std::vector<std::size_t> regions(end - first);
  std::iota(regions.begin(), regions.end(), first);
  return regions;
}

void MapLocalizer::TryRegion(std::size_t region,
                             std::uint64_t seed,
                             const Clock& clock,
                             ImageLocalization& localization) {
  const MonotonicTime start = clock();
  const std::span<const ScenePrediction> predictions = predictor_->Predict(region);
  const MonotonicTime predicted = clock();
  correspondences_.clear();
  for (const ScenePrediction& prediction : predictions) {
    correspondences_.push_back({.pixel = prediction.pixel, .p_WP = prediction.p_WP});
  }
  CameraPoseOptions options = options_;
  options.calibration = CalibrationOf(map_.regions[region].calibration);
  const CameraPoseResult pose =
      EstimateCameraPose(correspondences_, camera_, options, std::nullopt, seed);
  localization.head_time += predicted - start;
  localization.pose_time += clock() - predicted;
  if (localization.pose.correspondences > 0 && !IsBetterPose(pose, localization.pose)) return;
  localization.pose = pose;
  localization.region = pose.status == CameraPoseStatus::kOk ? static_cast<int>(region) : -1;
}

Result<ImageLocalization> MapLocalizer::Localize(const GrayImage& image,
                                                 std::uint64_t seed,
                                                 const Clock& clock) {
  ImageLocalization localization;
  const MonotonicTime start = clock();
  if (auto ok = predictor_->Extract(image); !ok) return std::move(ok).error();
  localization.features_time = clock() - start;
  for (const std::size_t region : RegionsToTry())
    TryRegion(region, seed, clock, localization);
  last_region_.reset();
  if (localization.region >= 0) last_region_ = static_cast<std::size_t>(localization.region);
  return localization;
}

}  // namespace relocd
