#include "relocalization/map_localizer.h"

#include <optional>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "relocalization/inference_config.h"
#include "relocalization/one_image_map.h"

namespace relocd {
namespace {

using ::testing::HasSubstr;

constexpr int kWidth = 320;
constexpr int kHeight = 240;

CameraIntrinsics SmallCamera() {
  CameraIntrinsics intrinsics{
      .fx = 260.0, .fy = 262.0, .cx = 158.0, .cy = 121.0, .width = kWidth, .height = kHeight};
  intrinsics.distortion = {-0.1, 0.01, 0.0005, -0.0003, 0.0};
  return intrinsics;
}

const Pose3 kPose(Eigen::Quaterniond(0.5, -0.5, 0.5, -0.5), Eigen::Vector3d(12.0, -7.0, 1.6));

SceneMap MakeMap() {
  return MakeOneImageMap(MakeTexturedImage(kWidth, kHeight, 1), SmallCamera(), kPose);
}

std::unique_ptr<MapLocalizer> MakeLocalizer(SceneMap map) {
  return MapLocalizer::Create(std::move(map), {}).value();
}

/// Time that goes on by one millisecond with each look at it.
class TickingClock {
 public:
  MonotonicTime operator()() { return FromNanoseconds(1'000'000 * ++*looks_); }

 private:
  std::shared_ptr<std::int64_t> looks_ = std::make_shared<std::int64_t>(0);
};

TEST(MapLocalizerTest, FindsTheCameraOfTheImageThatTheMapKnows) {
  const auto localizer = MakeLocalizer(MakeMap());
  const auto localization =
      localizer->Localize(MakeTexturedImage(kWidth, kHeight, 1), std::nullopt, 1, TickingClock());
  ASSERT_TRUE(localization) << localization.error().message;
  ASSERT_EQ(localization->pose.status, CameraPoseStatus::kOk);
  EXPECT_EQ(localization->region, 0);
  EXPECT_EQ(localization->pose.correspondences, 120);
  const Vector6d error = (kPose.Inverse() * localization->pose.X_WC).Log();
  EXPECT_LT(error.head<3>().norm(), 0.1);
  EXPECT_LT(error.tail<3>().norm(), 0.01);
}

TEST(MapLocalizerTest, TimesItsStagesByTheClockThatItIsGiven) {
  const auto localizer = MakeLocalizer(MakeMap());
  const auto localization =
      localizer->Localize(MakeTexturedImage(kWidth, kHeight, 1), std::nullopt, 1, TickingClock());
  ASSERT_TRUE(localization);
  EXPECT_EQ(localization->features_time, FromSeconds(1e-3));
  EXPECT_EQ(localization->head_time, FromSeconds(1e-3));
  EXPECT_EQ(localization->pose_time, FromSeconds(1e-3));
}

TEST(MapLocalizerTest, FindsNothingInAnotherImage) {
  const auto localizer = MakeLocalizer(MakeMap());
  const auto localization =
      localizer->Localize(MakeTexturedImage(kWidth, kHeight, 2), std::nullopt, 1, TickingClock());
  ASSERT_TRUE(localization);
  EXPECT_NE(localization->pose.status, CameraPoseStatus::kOk);
  EXPECT_EQ(localization->region, -1);
}

TEST(MapLocalizerTest, RefusesAnImageOfAnotherSize) {
  const auto localizer = MakeLocalizer(MakeMap());
  const auto localization =
      localizer->Localize(MakeTexturedImage(64, 48, 1), std::nullopt, 1, TickingClock());
  ASSERT_FALSE(localization);
  EXPECT_EQ(localization.error().kind, ErrorKind::kInvalidInput);
}

TEST(MapLocalizerTest, TakesThePoseOfTheRegionThatExplainsTheImage) {
  // Five regions of which the fourth knows the image; the others see every cell in one place.
  SceneMap map = MakeMap();
  const MapRegion knowing = map.regions.front();
  MapRegion empty;
  empty.head = MakeRandomHead(knowing.head.shape, 1);
  map.regions = {empty, empty, empty, knowing, empty};
  const auto localizer = MakeLocalizer(std::move(map));
  const GrayImage image = MakeTexturedImage(kWidth, kHeight, 1);
  const auto lost = localizer->Localize(image, std::nullopt, 1, TickingClock());
  ASSERT_TRUE(lost);
  EXPECT_EQ(lost->region, -1);
  EXPECT_EQ(lost->regions_tried, 3) << "the others come next";
  const auto first = localizer->Localize(image, std::nullopt, 1, TickingClock());
  EXPECT_EQ(first->region, 3);
  EXPECT_EQ(first->regions_tried, 3);
  EXPECT_EQ(first->head_time, FromSeconds(3e-3));

  const auto anywhere = localizer->LocalizeAnywhere(image, 1);
  ASSERT_TRUE(anywhere);
  EXPECT_EQ(anywhere->region, 3);
  EXPECT_EQ(anywhere->regions_tried, 5);
  EXPECT_EQ(anywhere->pose.X_WC.translation(), first->pose.X_WC.translation());
}

TEST(MapLocalizerTest, LooksWhereTheCameraIsExpected) {
  SceneMap map = MakeMap();
  const MapRegion knowing = map.regions.front();
  MapRegion empty;
  empty.head = MakeRandomHead(knowing.head.shape, 1);
  map.regions.assign(50, empty);
  map.regions[41] = knowing;
  map.regions[41].training_poses = {{kPose.translation().cast<float>(), 0.0F}};
  const auto localizer = MakeLocalizer(std::move(map));
  // Some way off, and without the height, which the map knows.
  const Eigen::Vector3d near(kPose.translation().x() - 2.0, kPose.translation().y() + 1.0, -30.0);
  const CameraPrior prior{.X_WC = Pose3(kPose.rotation(), near), .sigma_m = 2.0, .sigma_rad = 0.1};
  const GrayImage image = MakeTexturedImage(kWidth, kHeight, 1);
  const auto localization = localizer->Localize(image, prior, 1, TickingClock());
  ASSERT_TRUE(localization);
  EXPECT_EQ(localization->region, 41);
  EXPECT_LT((localization->pose.X_WC.translation() - kPose.translation()).norm(), 0.1);
  EXPECT_EQ(localizer->Localize(image, prior, 2, TickingClock())->regions_tried, 1);
}

TEST(MapLocalizerTest, APoseFarFromWhereTheRegionWasLearnedIsNone) {
  const Eigen::Vector3f here = kPose.translation().cast<float>();
  const struct {
    const char* what = "";
    TrainingPose learned;
    CameraPoseStatus expected = CameraPoseStatus::kOk;
  } cases[] = {
      {"beside", {here + Eigen::Vector3f(20.0F, 0.0F, 2.0F), 0.5F}, CameraPoseStatus::kOk},
      {"far", {here + Eigen::Vector3f(20.0F, 20.0F, 0.0F), 0.0F}, CameraPoseStatus::kOffRoute},
      {"above", {here - Eigen::Vector3f(0.0F, 0.0F, 12.0F), 0.0F}, CameraPoseStatus::kOffRoute},
      {"other way", {here, 3.0F}, CameraPoseStatus::kOffRoute}};
  for (const auto& [what, learned, expected] : cases) {
    SceneMap map = MakeMap();
    map.regions.front().training_poses = {learned};
    const auto localization =
        MakeLocalizer(std::move(map))
            ->Localize(MakeTexturedImage(kWidth, kHeight, 1), std::nullopt, 1, TickingClock());
    ASSERT_TRUE(localization);
    EXPECT_EQ(localization->pose.status, expected) << what;
    EXPECT_EQ(localization->region, expected == CameraPoseStatus::kOk ? 0 : -1) << what;
  }
}

TEST(MapLocalizerTest, AppliesTheCalibrationOfTheRegion) {
  SceneMap map = MakeMap();
  map.regions.front().calibration.confidence_threshold = 1.0;
  const auto localization =
      MakeLocalizer(std::move(map))
          ->Localize(MakeTexturedImage(kWidth, kHeight, 1), std::nullopt, 1, TickingClock());
  ASSERT_TRUE(localization);
  EXPECT_EQ(localization->pose.status, CameraPoseStatus::kLowConfidence);
}

TEST(MapLocalizerTest, APoseWhereItIsExpectedNeedsLessSupport) {
  const auto moved = [](double right_m, double turn_rad) {
    return kPose * Pose3::Exp((Vector6d() << right_m, 0.0, 0.5, 0.0, turn_rad, 0.0).finished());
  };
  const struct {
    const char* what = "";
    double needed = 0.0;  ///< Times the support that the pose has.
    std::optional<Pose3> expected_WC;
    CameraPoseStatus status = CameraPoseStatus::kOk;
  } cases[] = {
      {"where expected", 1.25, moved(1.0, 0.05), CameraPoseStatus::kOk},
      {"nowhere expected", 1.25, std::nullopt, CameraPoseStatus::kLowConfidence},
      {"expected elsewhere", 1.25, moved(3.0, 0.0), CameraPoseStatus::kLowConfidence},
      {"expected to look elsewhere", 1.25, moved(0.0, 0.2), CameraPoseStatus::kLowConfidence},
      {"hardly any support", 1.8, moved(1.0, 0.05), CameraPoseStatus::kLowConfidence}};
  const GrayImage image = MakeTexturedImage(kWidth, kHeight, 1);
  SceneMap map = MakeMap();
  const auto found = MakeLocalizer(map)->Localize(image, std::nullopt, 1, TickingClock());
  ASSERT_TRUE(found);
  for (const auto& [what, needed, expected_WC, status] : cases) {
    map.regions.front().calibration.confidence_threshold = needed * found->pose.confidence;
    map.regions.front().training_poses = {{kPose.translation().cast<float>(), 0.0F}};
    const auto prior = expected_WC ? std::optional(CameraPrior{*expected_WC}) : std::nullopt;
    const auto localization = MakeLocalizer(map)->Localize(image, prior, 1, TickingClock());
    ASSERT_TRUE(localization);
    EXPECT_EQ(localization->pose.status, status) << what;
  }
}

TEST(MapLocalizerTest, MakesProgressWithEachRegion) {
  SceneMap map = MakeMap();
  map.regions.resize(3, map.regions.front());
  int steps = 0;
  ASSERT_TRUE(MapLocalizer::Create(map, {}, [&steps] { ++steps; }));
  EXPECT_EQ(steps, 3);
}

TEST(MapLocalizerTest, SaysWhichMapIsMissing) {
  const auto none = MapLocalizer::Load({});
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().kind, ErrorKind::kInvalidInput);
  EXPECT_THAT(none.error().message, HasSubstr("map_path is empty, must name a map"));
  InferenceConfig config;
  config.map_path = "/nonexistent/site.relocmap";
  const auto missing = MapLocalizer::Load(config);
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().kind, ErrorKind::kInvalidInput);
  EXPECT_THAT(missing.error().message, HasSubstr("/nonexistent/site.relocmap"));
}

TEST(InferenceConfigTest, NamesTheFieldThatIsOutOfRange) {
  EXPECT_TRUE(InferenceConfig().Validate());
  InferenceConfig config;
  config.threads = 0;
  EXPECT_THAT(config.Validate().error().message, HasSubstr("threads is 0, must be in [1, 64]"));
  config = {};
  config.max_image_age_ms = -1;
  EXPECT_THAT(config.Validate().error().message, HasSubstr("max_image_age_ms is -1, must be in"));
  config = {};
  config.pose.max_tries = 0;
  EXPECT_THAT(config.Validate().error().message, HasSubstr("pose.max_tries is 0, must be in"));
}

}  // namespace
}  // namespace relocd
