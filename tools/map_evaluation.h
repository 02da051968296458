#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "camera/dataset.h"
#include "camera/image.h"
#include "core/result.h"
#include "geometry/pose3.h"
#include "relocalization/camera_pose_estimator.h"
#include "scene_coordinates/map_file.h"

namespace relocd {

/// What came out for one frame.
struct FrameLocalization {
  DatasetFrame frame;     ///< In the data set's world.
  CameraPoseResult pose;  ///< In W.
  std::size_t region = 0;
  double milliseconds = 0.0;  ///< From the JPEG's bytes to the pose.
};

/// Finds the camera of each frame by itself, without knowing where the one before was: all regions
/// are tried, and the pose with the most support is kept.
///
/// @param threads  each works on frames of its own; the result does not depend on them.
/// @param change   what is done to each image first, if anything; called by several threads.
Result<std::vector<FrameLocalization>> LocalizeFrames(
    const SceneMap& map,
    const std::vector<DatasetFrame>& frames,
    int threads,
    const std::function<GrayImage(const GrayImage& image, int index)>& change = {});

/// Errors against the data set's poses.
struct PoseErrors {
  std::size_t frames = 0;
  std::size_t localized = 0;
  double median_m = 0.0;  ///< Of the localized frames, as the next two.
  double p95_m = 0.0;
  double median_rad = 0.0;
  double within_1m = 0.0;  ///< Share of all frames.
  double within_95 =
      0.0;  ///< Share of localized frames inside the 95 % region of their covariance.
  /// Spearman's correlation of the reported position sigma and the error, in [-1, 1].
  double sigma_rank_correlation = 0.0;
  std::size_t wrong_10m = 0;  ///< Localized frames that are off by more than that.
  double median_ms = 0.0;
  double p99_ms = 0.0;
};

PoseErrors MeasureErrors(const SceneMap& map, const std::vector<FrameLocalization>& localizations);

/// How well the localized frames were: median, p95 and so on, without how many they are.
std::string FormatAccuracy(const PoseErrors& errors);

/// The error of a pose, as its covariance sees it: X_WC_true = X_WC * Exp(error).
Vector6d PoseError(const SceneMap& map, const FrameLocalization& localization);

/// In [0, 1]; `values` must not be empty.
double Quantile(std::vector<double> values, double share);

}  // namespace relocd
