#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "camera/pinhole_camera.h"
#include "relocalization/image_localizer.h"
#include "scene_coordinates/map_file.h"
#include "scene_coordinates/scene_coordinate_predictor.h"

namespace relocd {

/// Localises images with a map: features, the heads of the regions that are worth a try, the pose
/// of the scene coordinates.
///
/// Regions follow each other along the route. After a pose from one of them only this one and its
/// neighbours are tried, so that the time for an image does not grow with the map; without one,
/// all.
///
/// Thread-bound.
class MapLocalizer final : public ImageLocalizer {
 public:
  /// @param options  valid; their calibration is replaced by that of each region.
  /// @param threads  of the network, >= 1.
  static Result<std::unique_ptr<MapLocalizer>> Create(SceneMap map,
                                                      const CameraPoseOptions& options,
                                                      int threads);

  /// Reads the map from a file. @return as ReadMap, and kInvalidInput for an empty path.
  static Result<std::unique_ptr<MapLocalizer>> Load(const std::string& path,
                                                    const CameraPoseOptions& options,
                                                    int threads);

  [[nodiscard]] const CameraIntrinsics& camera() const override { return map_.camera; }
  [[nodiscard]] const std::string& map_id() const override { return map_.id; }
  [[nodiscard]] const SceneMap& map() const { return map_; }

  Result<ImageLocalization> Localize(const GrayImage& image,
                                     std::uint64_t seed,
                                     const Clock& clock) override;

 private:
  MapLocalizer(SceneMap map, const CameraPoseOptions& options);

  [[nodiscard]] std::vector<std::size_t> RegionsToTry() const;
  void TryRegion(std::size_t region,
                 std::uint64_t seed,
                 const Clock& clock,
                 ImageLocalization& localization);

  SceneMap map_;
  PinholeCamera camera_;
  CameraPoseOptions options_;
  std::unique_ptr<SceneCoordinatePredictor> predictor_;
  std::vector<Correspondence> correspondences_;
  std::optional<std::size_t> last_region_;  ///< Of the last image, if that gave a pose.
};

}  // namespace relocd
