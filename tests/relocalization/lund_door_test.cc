#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <numbers>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "camera/dataset.h"
#include "core/file.h"
#include "relocalization/camera_pose_estimator.h"
#include "relocalization/test_scene.h"
#include "support/shared_data.h"

namespace relocd {
namespace {

constexpr double kDegrees = 180.0 / std::numbers::pi;
constexpr double kOutlierShare = 0.3;
/// What is further from where it must be is called an outlier, in px.
constexpr double kNamedOutlierPx = 8.0;

/// Correspondences of one photo, and which of them are wrong.
struct Photo {
  Pose3 X_WC;
  std::vector<Correspondence> correspondences;
  std::vector<bool> is_outlier;
};

/// How a photo's pose came out.
struct Outcome {
  double error_deg = 0.0;
  double error = 0.0;        ///< Of the position, in the scene's unit.
  std::size_t outliers = 0;  ///< Replaced by something else.
  std::size_t named = 0;     ///< Of them, called outliers.
  std::size_t wronged = 0;   ///< Of the others, called outliers.
  std::size_t inliers = 0;
};

/// P3P, RANSAC and refinement with the threshold of exact pixels instead of learned points.
Outcome Localize(const Photo& photo, const PinholeCamera& camera, std::uint64_t seed) {
  CameraPoseOptions options;
  options.inlier_threshold_mrad = 1e3 * 3.0 / camera.intrinsics().fx;
  options.scored_points = 1000;
  const CameraPoseResult result =
      EstimateCameraPose(photo.correspondences, camera, options, std::nullopt, seed);
  EXPECT_EQ(result.status, CameraPoseStatus::kOk);
  Outcome outcome;
  outcome.error = (result.X_WC.translation() - photo.X_WC.translation()).norm();
  outcome.error_deg = kDegrees * AngleBetween(result.X_WC.rotation(), photo.X_WC.rotation());
  const Pose3 X_CW = result.X_WC.Inverse();
  for (std::size_t i = 0; i < photo.correspondences.size(); ++i) {
    const auto seen = camera.Project(X_CW * photo.correspondences[i].p_WP);
    const bool called = !seen || (*seen - photo.correspondences[i].pixel).norm() > kNamedOutlierPx;
    if (photo.is_outlier[i]) {
      ++outcome.outliers;
      if (called) ++outcome.named;
    } else {
      ++outcome.inliers;
      if (called) ++outcome.wronged;
    }
  }
  return outcome;
}

/// The photo's points where they are seen, but for those that are replaced by any other pixel.
class PhotoMaker {
 public:
  PhotoMaker(const PinholeCamera& camera, unsigned seed) : camera_(camera), random_(seed) {}

  void Add(const Eigen::Vector3d& p_WP, double sigma_px, Photo& photo) {
    const auto seen = camera_.Project(photo.X_WC.Inverse() * p_WP);
    if (!seen) return;
    const CameraIntrinsics& size = camera_.intrinsics();
    Eigen::Vector2d pixel =
        *seen + Eigen::Vector2d(random_.Normal(sigma_px), random_.Normal(sigma_px));
    const bool is_outlier = random_.Uniform(0.0, 1.0) < kOutlierShare;
    while (is_outlier && (pixel - *seen).norm() < 2.0 * kNamedOutlierPx) {
      pixel = {random_.Uniform(0.0, size.width), random_.Uniform(0.0, size.height)};
    }
    photo.correspondences.push_back({pixel, p_WP});
    photo.is_outlier.push_back(is_outlier);
  }

 private:
  const PinholeCamera& camera_;
  SceneRandom random_;
};

/// The extent of nine tenths of the points along the axis in which it is greatest.
double SizeOf(const std::vector<Eigen::Vector3d>& points) {
  double size = 0.0;
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (const Eigen::Vector3d& point : points)
      values.push_back(point[axis]);
    std::sort(values.begin(), values.end());
    size = std::max(size, values[values.size() * 95 / 100] - values[values.size() * 5 / 100]);
  }
  return size;
}

void ExpectExact(const Outcome& outcome, double scene_size) {
  EXPECT_LT(outcome.error_deg, 0.1);
  EXPECT_LT(outcome.error, 1e-3 * scene_size);
  EXPECT_EQ(outcome.named, outcome.outliers);
  EXPECT_LE(outcome.wronged, outcome.inliers / 100);
}

TEST(LundDoorTest, PosesAreExactWithThreeOfTenReplaced) {
  const std::string folder = SharedData("lund_door");
  if (folder.empty()) GTEST_SKIP() << SharedDataReason("lund_door");
  const auto dataset = ReadDataset(folder);
  ASSERT_TRUE(dataset) << dataset.error().message;
  const PinholeCamera camera(dataset->intrinsics);
  std::vector<Photo> photos;
  for (const DatasetFrame& frame : dataset->frames)
    photos.push_back({frame.X_WC, {}, {}});
  PhotoMaker maker(camera, 7);
  std::vector<Eigen::Vector3d> points;
  std::istringstream lines(ReadFile(folder + "/points3D.txt").value());
  for (std::string line; std::getline(lines, line);) {
    if (line.empty() || line.front() == '#') continue;
    std::istringstream words(line);
    double id = 0.0;
    double colour = 0.0;
    double error_px = 0.0;
    Eigen::Vector3d p_WP;
    words >> id >> p_WP.x() >> p_WP.y() >> p_WP.z() >> colour >> colour >> colour >> error_px;
    points.push_back(p_WP);
    std::size_t image = 0;
    std::size_t corner = 0;
    // The mean of a distance in the plane is sqrt(pi / 2) of the deviation along each axis.
    const double sigma_px = error_px / std::sqrt(0.5 * std::numbers::pi);
    while (words >> image >> corner) {
      if (image >= 1 && image <= photos.size()) maker.Add(p_WP, sigma_px, photos[image - 1]);
    }
  }
  const double size = SizeOf(points);
  for (std::size_t i = 0; i < photos.size(); ++i) {
    SCOPED_TRACE(dataset->frames[i].image_path);
    ASSERT_GT(photos[i].correspondences.size(), 500U);
    const Outcome outcome = Localize(photos[i], camera, i);
    std::printf(
        "%2zu: %zu points, %.4f deg, %.4f %% of the size, %zu of %zu outliers named, "
        "%zu of %zu others called so\n",
        i,
        photos[i].correspondences.size(),
        outcome.error_deg,
        100.0 * outcome.error / size,
        outcome.named,
        outcome.outliers,
        outcome.wronged,
        outcome.inliers);
    ExpectExact(outcome, size);
  }
}

TEST(LundDoorTest, AMadeDoorIsNoHarder) {
  const CameraIntrinsics intrinsics = {.fx = 2435.0,
                                       .fy = 2435.0,
                                       .cx = 648.0,
                                       .cy = 968.0,
                                       .width = 1296,
                                       .height = 1936,
                                       .distortion = {-0.0336, 0.0, 0.0, 0.0, 0.0}};
  const PinholeCamera camera(intrinsics);
  for (unsigned seed = 0; seed < 60; ++seed) {
    SCOPED_TRACE(seed);
    SceneRandom random(seed);
    Photo photo;
    photo.X_WC = random.Pose();
    PhotoMaker maker(camera, seed + 1000);
    std::vector<Eigen::Vector3d> points;
    for (int i = 0; i < 2000; ++i) {
      const Eigen::Vector2d pixel(random.Uniform(0.0, 1295.0), random.Uniform(0.0, 1935.0));
      const double depth = random.Uniform(13.0, 18.0);
      points.push_back(photo.X_WC *
                       Eigen::Vector3d(depth * camera.Unproject(pixel)->homogeneous()));
      maker.Add(points.back(), 0.7, photo);
    }
    ExpectExact(Localize(photo, camera, seed), SizeOf(points));
  }
}

}  // namespace
}  // namespace relocd
