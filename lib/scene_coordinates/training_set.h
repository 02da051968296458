#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "camera/image.h"
#include "camera/measured_depth.h"
#include "camera/pinhole_camera.h"
#include "core/result.h"
#include "features/feature_whitening.h"
#include "features/gradient_maps.h"
#include "geometry/pose3.h"
#include "scene_coordinates/bfloat16.h"
#include "scene_coordinates/light_changes.h"

namespace relocd {

/// An image of the drive that a map is made of, and where the camera was.
struct TrainingImage {
  GrayImage image;
  Pose3 X_WC;
  int drive = 0;          ///< Depths are looked for between images of one drive, in one light.
  MeasuredDepth depth{};  ///< Of the image's size, or empty: then all depths are looked for.
};

/// Where a training cell looks.
struct TrainingTarget {
  float x = 0.0F;  ///< The viewing ray is (x, y, 1) in C.
  float y = 0.0F;
  float inverse_depth = 0.0F;  ///< 1/m along C's z; 0 when it is not known.
  std::uint32_t image = 0;     ///< Whose pose holds for this cell.
};

/// Cells of all images and of changed copies of them, whitened: what a head is trained on.
struct TrainingSet {
  int dimension = 0;
  std::vector<Bfloat16> features;  ///< targets.size() x dimension, row-major.
  std::vector<TrainingTarget> targets;
  std::vector<Pose3> X_WCs;      ///< Of each image.
  double focal_px = 0.0;         ///< In working pixels, in which errors are measured.
  double typical_depth_m = 0.0;  ///< Median of the known depths.
};

struct TrainingSetConfig {
  int cells_per_view = 1600;   ///< > 0
  int views_per_image = 6;     ///< > 0; the first is the image as it is.
  double max_scale = 1.35;     ///< >= 1; copies are enlarged or reduced by up to this factor.
  double max_roll_rad = 0.12;  ///< >= 0
  double max_blur_px = 1.2;    ///< >= 0; standard deviation in working pixels.
  LightChanges light;          ///< Of the copies.
  bool measure_depth = true;   ///< Find depths that were not given, by neighbouring images.
  std::uint64_t seed = 1;
  int threads = 1;  ///< > 0; the result does not depend on it.
};

/// The whitening of a map, which all its regions share: fitted to a sample of these images' cells.
///
/// @param images  a few hundred from all along the route say enough.
/// @param outputs  dimensions that are kept, > 0.
/// @return kInvalidInput when an image has not the configured size, or there are too few cells.
Result<FeatureWhitening> FitWhiteningToImages(const std::vector<GrayImage>& images,
                                              const GradientHistogramsConfig& features,
                                              int outputs);

/// Extracts, measures depths and whitens. `progress` is called with the share done, from one
/// thread at a time.
///
/// @param whitening  of this extractor's features.
/// @return kInvalidInput when an image, or its depth, has not the configured size.
Result<TrainingSet> PrepareTraining(const std::vector<TrainingImage>& images,
                                    const PinholeCamera& camera,
                                    const GradientHistogramsConfig& features,
                                    const FeatureWhitening& whitening,
                                    const TrainingSetConfig& config,
                                    const std::function<void(double)>& progress);

}  // namespace relocd
