#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "camera/pinhole_camera.h"
#include "core/progress.h"
#include "relocalization/image_localizer.h"
#include "relocalization/inference_config.h"
#include "relocalization/region_selector.h"
#include "scene_coordinates/map_file.h"
#include "scene_coordinates/scene_coordinate_predictor.h"

namespace relocd {

/// Localises images with a map: features, the heads of the regions that are worth a try, the pose
/// of the scene coordinates.
///
/// Thread-bound.
class MapLocalizer final : public ImageLocalizer {
 public:
  /// @param config  valid; the calibration of its pose options is replaced by that of each region,
  ///                and its map_path is not looked at.
  static Result<std::unique_ptr<MapLocalizer>> Create(SceneMap map,
                                                      const InferenceConfig& config,
                                                      const Progress& progress = Unwatched);

  /// Reads the map of the config. @return as ReadMap, and kInvalidInput for an empty path.
  static Result<std::unique_ptr<MapLocalizer>> Load(const InferenceConfig& config,
                                                    const Progress& progress = Unwatched);

  [[nodiscard]] const CameraIntrinsics& camera() const override { return map_.camera; }
  [[nodiscard]] const std::string& map_id() const override { return map_.id; }
  [[nodiscard]] bool uses_bfloat16() const override {
    return predictor_->precision() == Precision::kBfloat16;
  }
  [[nodiscard]] const SceneMap& map() const { return map_; }

  Result<ImageLocalization> Localize(const GrayImage& image,
                                     const std::optional<CameraPrior>& prior,
                                     std::uint64_t seed,
                                     const Clock& clock) override;

  /// Tries all regions, and neither uses nor changes what is known from other images: the result
  /// depends on the image and the seed alone.
  Result<ImageLocalization> LocalizeAnywhere(const GrayImage& image, std::uint64_t seed);

 private:
  MapLocalizer(SceneMap map, const InferenceConfig& config);

  /// A planar prior knows no height: the nearest training pose's is taken.
  [[nodiscard]] Pose3 AtTrainedHeight(const Pose3& X_WC) const;
  void TryRegion(std::size_t region,
                 const std::optional<Pose3>& prior,
                 std::uint64_t seed,
                 const Clock& clock,
                 ImageLocalization& localization);

  SceneMap map_;
  PinholeCamera camera_;
  CameraPoseOptions options_;
  std::unique_ptr<SceneCoordinatePredictor> predictor_;
  std::vector<Correspondence> correspondences_;
  RegionSelector selector_;  ///< Borrows the map's regions.
};

}  // namespace relocd
