#include "camera/pinhole_camera.h"

#include <cmath>
#include <limits>
#include <optional>

#include <Eigen/Geometry>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/eigen_matchers.h"
#include "support/random.h"

namespace relocd {
namespace {

constexpr int kTrials = 1000;

CameraIntrinsics Undistorted() {
  return {.fx = 500.0, .fy = 510.0, .cx = 320.0, .cy = 240.0, .width = 640, .height = 480};
}

/// Barrel distortion as of a cheap wide-angle lens.
CameraIntrinsics WideAngle() {
  CameraIntrinsics intrinsics = Undistorted();
  intrinsics.distortion = {-0.28, 0.07, 0.0012, -0.0007, -0.005};
  return intrinsics;
}

/// A point whose direction is within about 39 degrees of the axis, as the image's corners are.
Eigen::Vector3d VisiblePoint(TestRandom& random) {
  const double depth = random.Uniform(0.2, 50.0);
  return {depth * random.Uniform(-0.64, 0.64), depth * random.Uniform(-0.48, 0.48), depth};
}

TEST(PinholeCameraTest, ProjectsAPointOnTheAxisToThePrincipalPoint) {
  const PinholeCamera camera(WideAngle());
  EXPECT_THAT(camera.Project({0.0, 0.0, 3.0}).value(),
              IsNear(Eigen::Vector2d(320.0, 240.0), 1e-12));
}

TEST(PinholeCameraTest, ProjectsByFocalLengthOverDepth) {
  const PinholeCamera camera(Undistorted());
  EXPECT_THAT(camera.Project({1.0, -2.0, 10.0}).value(),
              IsNear(Eigen::Vector2d(370.0, 138.0), 1e-12));
}

TEST(PinholeCameraTest, DistortsAsTheBrownModelSays) {
  // With x = 0.5, y = 0 and r^2 = 0.25: radial 1 - 0.28/4 + 0.07/16 - 0.005/64 = 0.934296875.
  const PinholeCamera camera(WideAngle());
  const double x = 0.5 * 0.934296875 + -0.0007 * (0.25 + 2.0 * 0.25);
  const double y = 0.0012 * 0.25;
  EXPECT_THAT(camera.Project({0.5, 0.0, 1.0}).value(),
              IsNear(Eigen::Vector2d(500.0 * x + 320.0, 510.0 * y + 240.0), 1e-10));
}

TEST(PinholeCameraTest, UnprojectUndoesProject) {
  for (const CameraIntrinsics& intrinsics : {Undistorted(), WideAngle()}) {
    const PinholeCamera camera(intrinsics);
    TestRandom random(1);
    for (int trial = 0; trial < kTrials; ++trial) {
      const Eigen::Vector3d p_CP = VisiblePoint(random);
      const std::optional<Eigen::Vector2d> ray = camera.Unproject(camera.Project(p_CP).value());
      ASSERT_TRUE(ray.has_value()) << p_CP.transpose();
      EXPECT_THAT(*ray, IsNear(Eigen::Vector2d(p_CP.head<2>() / p_CP.z()), 1e-10));
    }
  }
}

TEST(PinholeCameraTest, UnprojectsEveryPixelOfTheImage) {
  const PinholeCamera camera(WideAngle());
  for (int v = 0; v < 480; v += 13) {
    for (int u = 0; u < 640; u += 13) {
      const Eigen::Vector2d pixel(u, v);
      const std::optional<Eigen::Vector2d> ray = camera.Unproject(pixel);
      ASSERT_TRUE(ray.has_value()) << pixel.transpose();
      EXPECT_THAT(camera.Project(ray->homogeneous()).value(), IsNear(pixel, 1e-8));
    }
  }
}

TEST(PinholeCameraTest, JacobianAgreesWithDifferences) {
  for (const CameraIntrinsics& intrinsics : {Undistorted(), WideAngle()}) {
    const PinholeCamera camera(intrinsics);
    TestRandom random(2);
    for (int trial = 0; trial < kTrials; ++trial) {
      const Eigen::Vector3d p_CP = VisiblePoint(random);
      const double step = 1e-6 * p_CP.z();
      Eigen::Matrix<double, 2, 3> numeric;
      for (int axis = 0; axis < 3; ++axis) {
        const Eigen::Vector3d offset = step * Eigen::Vector3d::Unit(axis);
        numeric.col(axis) =
            (camera.Project(p_CP + offset).value() - camera.Project(p_CP - offset).value()) /
            (2.0 * step);
      }
      const Eigen::Matrix<double, 2, 3> J = camera.ProjectWithJacobian(p_CP).value().J_p_CP;
      EXPECT_THAT(J, IsNear(numeric, 1e-6 * numeric.norm()));
    }
  }
}

TEST(PinholeCameraTest, SeesNothingBehindItself) {
  const PinholeCamera camera(Undistorted());
  EXPECT_FALSE(camera.Project({0.0, 0.0, 0.0}).has_value());
  EXPECT_FALSE(camera.Project({1.0, 1.0, -2.0}).has_value());
}

TEST(PinholeCameraTest, RefusesDirectionsWhereTheDistortionFoldsBack) {
  // r (1 - 0.3 r^2) increases up to r = 1 / sqrt(0.9) = 1.054 and comes back to the image after.
  CameraIntrinsics intrinsics = Undistorted();
  intrinsics.distortion = {-0.3, 0.0, 0.0, 0.0, 0.0};
  const PinholeCamera camera(intrinsics);
  EXPECT_TRUE(camera.Project({1.05, 0.0, 1.0}).has_value());
  EXPECT_FALSE(camera.Project({1.06, 0.0, 1.0}).has_value());
  EXPECT_FALSE(camera.Project({1.8, 0.0, 1.0}).has_value());
  // The largest radius that the lens reaches is 0.703, at pixel 671: no ray leads beyond.
  EXPECT_TRUE(camera.Unproject({670.0, 240.0}).has_value());
  EXPECT_FALSE(camera.Unproject({700.0, 240.0}).has_value());
}

TEST(PinholeCameraTest, RefusesWhatIsNotFinite) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  for (const CameraIntrinsics& intrinsics : {Undistorted(), WideAngle()}) {
    const PinholeCamera camera(intrinsics);
    EXPECT_FALSE(camera.Project({kNan, 0.0, 1.0}).has_value());
    EXPECT_FALSE(camera.Project({0.0, 0.0, kInfinity}).has_value());
    EXPECT_FALSE(camera.Unproject({kNan, 0.0}).has_value());
    EXPECT_FALSE(camera.Unproject({0.0, kInfinity}).has_value());
  }
}

}  // namespace
}  // namespace relocd
