#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "camera/image.h"
#include "core/progress.h"
#include "core/result.h"
#include "features/gradient_histograms.h"
#include "scene_coordinates/head.h"
#include "scene_coordinates/map_file.h"
#include "scene_coordinates/onednn_head.h"

namespace relocd {

/// Where one cell of an image is, in the image and in the map.
struct ScenePrediction {
  Eigen::Vector2d pixel;  ///< (u, v) in the image as it was given, with its distortion.
  Eigen::Vector3d p_WP;   ///< m
  float confidence = 0;   ///< In [0, 1].
};

/// Image in, scene coordinates out, with everything made once: the run-time half of a map.
///
/// Use: `Extract(image)` once, then `Predict(region)` for each region to try. Keeps its buffers;
/// thread-bound. Borrows the map, which must outlive it.
class SceneCoordinatePredictor {
 public:
  /// The heads run in the precision that is the faster one when it is tried.
  /// @param threads  of features and matrix products, >= 1.
  /// @param progress  called after each region's head.
  static Result<std::unique_ptr<SceneCoordinatePredictor>> Create(
      const SceneMap& map, int threads, const Progress& progress = Unwatched);

  [[nodiscard]] Precision precision() const { return precision_; }

  /// @return kInvalidInput when the image has not the size of the map's camera.
  Result<void> Extract(const GrayImage& image);

  /// The predictions of one region's head for the image last extracted. Valid until the next call.
  std::span<const ScenePrediction> Predict(std::size_t region);

 private:
  explicit SceneCoordinatePredictor(const SceneMap& map) : map_(map) {}

  const SceneMap& map_;
  Precision precision_ = Precision::kFloat32;
  std::unique_ptr<GradientHistograms> extractor_;
  std::unique_ptr<OnednnLayers> whitening_;
  std::vector<std::unique_ptr<OnednnLayers>> heads_;
  CellFeatures features_;
  std::vector<float> whitened_;
  std::vector<float> outputs_;
  std::vector<ScenePrediction> predictions_;
};

}  // namespace relocd
