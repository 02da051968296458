#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "camera/intrinsics.h"
#include "core/progress.h"
#include "core/result.h"
#include "features/feature_whitening.h"
#include "features/gradient_maps.h"
#include "geometry/pose3.h"
#include "scene_coordinates/head.h"

namespace relocd {

/// The version that this program writes, and the only one that it reads.
inline constexpr std::uint32_t kMapFormatVersion = 2;

/// A place of the training drive, coarse: to tell whether a region is near a pose.
struct TrainingPose {
  Eigen::Vector3f p_WC = Eigen::Vector3f::Zero();  ///< Camera position, m.
  float heading_rad = 0.0F;                        ///< Of the camera's optical axis about W's z.
};

/// How far the covariances and confidences of poses from this region can be trusted, measured on
/// frames that were held out of its training.
struct RegionCalibration {
  double covariance_factor = 1.0;   ///< The estimate's 6x6 covariance is multiplied by it, >= 1.
  double sigma_floor_m = 0.0;       ///< Added in squares to each direction's standard deviation.
  double sigma_floor_rad = 0.0;     ///< The same about each axis.
  double confidence_threshold = 0;  ///< In [0, 1]; with less there is no pose unless expected.
};

/// One stretch of the route, and the head that knows it.
struct MapRegion {
  std::string name;
  Head head;
  RegionCalibration calibration;
  std::vector<TrainingPose> training_poses;
};

/// Where the map came from and how good it was on held-out frames.
struct TrainingSummary {
  std::string dataset;          ///< Name of the data set's folder.
  std::string program_version;  ///< Of the trainer.
  std::uint64_t seed = 0;
  std::uint32_t training_frames = 0;
  std::uint32_t held_out_frames = 0;
  double median_error_m = 0.0;  ///< On held-out frames, as all below.
  double p95_error_m = 0.0;
  double median_error_rad = 0.0;
  double within_1m = 0.0;  ///< Share of frames, in [0, 1].
};

/// A map for relocalisation: everything that is needed to turn an image into scene coordinates.
struct SceneMap {
  CameraIntrinsics camera;
  /// The world of the training data set in the map's frame: p_W = R_WD * p_D. W's z is up.
  Eigen::Quaterniond R_WD = Eigen::Quaterniond::Identity();
  GradientHistogramsConfig features;
  std::uint32_t cells_per_image = 1200;
  FeatureWhitening whitening;
  TrainingSummary training;
  std::vector<MapRegion> regions;
  /// Set when read: the sha256 of the content in hexadecimal, which names the map.
  std::string id;
};

/// The bytes of a map file: an 8-byte magic, the format version, the content's length and sha256,
/// and the content. Little-endian; weights are kept in half precision.
std::string SerializeMap(const SceneMap& map);

/// @param name  of the file, for errors.
/// @return kInvalidInput when the bytes are no map, are cut short, of another format version, do
///         not match their hash, or hold a value out of range; each names what was found and what
///         is allowed. Safe for any bytes.
Result<SceneMap> ParseMap(std::string_view bytes,
                          const std::string& name,
                          const Progress& progress = Unwatched);

/// @return as ParseMap, and kInvalidInput when there is no such file.
Result<SceneMap> ReadMap(const std::string& path, const Progress& progress = Unwatched);
/// Replaces the file as a whole or not at all.
Result<void> WriteMap(const SceneMap& map, const std::string& path);

/// `value` as it comes back from half precision. Larger magnitudes than 65504 are clamped.
float RoundToHalf(float value);

}  // namespace relocd
