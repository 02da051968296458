#include "inferenced/inference_node.h"

#include <chrono>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "messaging/in_process_bus.h"
#include "relocalization/map_localizer.h"
#include "relocalization/one_image_map.h"
#include "support/eigen_matchers.h"
#include "support/test_images.h"

namespace relocd {
namespace {

using ::testing::HasSubstr;

constexpr int kWidth = 320;
constexpr int kHeight = 240;
constexpr std::int64_t kImageTimeNs = 5'000'000'000;
constexpr std::int64_t kRunId = 77;

CameraIntrinsics SmallCamera() {
  return {.fx = 260.0, .fy = 262.0, .cx = 158.0, .cy = 121.0, .width = kWidth, .height = kHeight};
}

const Pose3 kPose(Eigen::Quaterniond(0.5, -0.5, 0.5, -0.5), Eigen::Vector3d(12.0, -7.0, 1.6));

/// 1.2 m ahead of the body's origin and 1.5 m above it, looking ahead.
const Pose3 kMounting(Eigen::Quaterniond(0.5, -0.5, 0.5, -0.5), Eigen::Vector3d(1.2, 0.0, 1.5));

/// Says what the test tells it to say.
class FakeLocalizer final : public ImageLocalizer {
 public:
  [[nodiscard]] const CameraIntrinsics& camera() const override { return camera_; }
  [[nodiscard]] const std::string& map_id() const override { return map_id_; }
  Result<ImageLocalization> Localize(const GrayImage& image,
                                     const std::optional<CameraPrior>& prior,
                                     std::uint64_t seed,
                                     const Clock& /*clock*/) override {
    EXPECT_EQ(image.width, kWidth);
    EXPECT_EQ(image.height, kHeight);
    seeds.push_back(seed);
    priors.push_back(prior);
    return answer;
  }

  ImageLocalization answer;
  std::vector<std::uint64_t> seeds;
  std::vector<std::optional<CameraPrior>> priors;

 private:
  CameraIntrinsics camera_ = SmallCamera();
  std::string map_id_ = "00000000000000f0aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa";
};

ImageLocalization GoodAnswer() {
  ImageLocalization answer;
  answer.pose.status = CameraPoseStatus::kOk;
  answer.pose.X_WC = kPose;
  answer.pose.covariance = 0.01 * Matrix6d::Identity();
  answer.pose.covariance(0, 4) = answer.pose.covariance(4, 0) = 0.002;
  answer.pose.correspondences = 1200;
  answer.pose.inliers = 900;
  answer.pose.hypotheses = 64;
  answer.pose.reprojection_rms_px = 3.5;
  answer.pose.confidence = 0.7;
  answer.region = 2;
  answer.features_time = std::chrono::microseconds(7000);
  answer.head_time = std::chrono::microseconds(5000);
  answer.pose_time = std::chrono::microseconds(900);
  return answer;
}

image_t MakeImage(std::vector<std::uint8_t> jpeg, std::int64_t seq = 3) {
  image_t image{};
  image.utime = 1'600'000'000'000'000;
  image.width = kWidth;
  image.height = kHeight;
  image.pixelformat = 0x47504A4D;
  image.size = static_cast<std::int32_t>(jpeg.size());
  image.data = std::move(jpeg);
  SetImageMetadata({.mono_ns = kImageTimeNs, .seq = seq, .run_id = 9}, image);
  image.nmetadata = static_cast<std::int32_t>(image.metadata.size());
  return image;
}

class InferenceNodeTest : public testing::Test {
 protected:
  InferenceNodeTest() {
    auto localizer = std::make_unique<FakeLocalizer>();
    localizer_ = localizer.get();
    localizer_->answer = GoodAnswer();
    node_ = std::make_unique<InferenceNode>(InferenceConfig{},
                                            std::move(localizer),
                                            std::map<std::string, Pose3>{{"front", kMounting}},
                                            bus_,
                                            kRunId,
                                            [this] { return now_; });
    bus_.Subscribe<camera_pose_t>(
        channels::kCameraPose, Delivery::kEvery, [this](const camera_pose_t& answer) {
          answers_.push_back(answer);
        });
  }

  static image_t GoodImage(std::int64_t seq = 3) {
    return MakeImage(MakeTestJpeg(kWidth, kHeight), seq);
  }

  /// What the node says of an image.
  camera_pose_t Ask(const image_t& image) {
    answers_.clear();
    node_->Handle("front", image);
    bus_.HandlePending();
    EXPECT_EQ(answers_.size(), 1U);
    return answers_.empty() ? camera_pose_t{} : answers_.front();
  }

  /// 30 ms after the image was taken, and it stands still.
  ClockReading now_{.monotonic = FromNanoseconds(kImageTimeNs + 30'000'000),
                    .realtime_us = 1'600'000'000'030'000};
  InProcessBus bus_;
  FakeLocalizer* localizer_ = nullptr;
  std::unique_ptr<InferenceNode> node_;
  std::vector<camera_pose_t> answers_;
};

TEST_F(InferenceNodeTest, SaysWhereTheCameraWas) {
  const camera_pose_t answer = Ask(GoodImage());
  EXPECT_EQ(answer.status, camera_pose_t::STATUS_OK);
  EXPECT_EQ(answer.message, "");
  EXPECT_EQ(answer.utime, 1'600'000'000'000'000);
  EXPECT_EQ(answer.mono_ns, kImageTimeNs);
  EXPECT_EQ(answer.seq, 0);
  EXPECT_EQ(answer.run_id, kRunId);
  EXPECT_EQ(answer.camera, "front");
  EXPECT_EQ(answer.image_seq, 3);
  EXPECT_EQ(answer.image_run_id, 9);
  EXPECT_EQ(answer.map_id, "00000000000000f0");
  EXPECT_EQ(answer.region, 2);
  EXPECT_EQ(answer.correspondences, 1200);
  EXPECT_EQ(answer.inliers, 900);
  EXPECT_EQ(answer.hypotheses, 64);
  EXPECT_DOUBLE_EQ(answer.reprojection_rms_px, 3.5);
  EXPECT_DOUBLE_EQ(answer.confidence, 0.7);
  EXPECT_THAT(Eigen::Vector3d(answer.pos), IsNear(kPose.translation(), 1e-12));
  EXPECT_THAT(Eigen::Vector4d(answer.quat), IsNear(Eigen::Vector4d(0.5, -0.5, 0.5, -0.5), 1e-12));
  EXPECT_DOUBLE_EQ(answer.covariance[0], 0.01);
  EXPECT_DOUBLE_EQ(answer.covariance[4], 0.002);
  EXPECT_DOUBLE_EQ(answer.covariance[35], 0.01);
  EXPECT_EQ(answer.features_us, 7000);
  EXPECT_EQ(answer.head_us, 5000);
  EXPECT_EQ(answer.pose_us, 900);
  EXPECT_EQ(answer.decode_us, 0) << "the clock stands still";
  EXPECT_EQ(answer.age_us, 30'000);
}

TEST_F(InferenceNodeTest, CountsItsMessages) {
  EXPECT_EQ(Ask(GoodImage()).seq, 0);
  EXPECT_EQ(Ask(GoodImage()).seq, 1);
  EXPECT_EQ(node_->counters().images, 2);
  EXPECT_EQ(node_->counters().poses, 2);
}

TEST_F(InferenceNodeTest, DrawsBySequenceNumberAndMap) {
  Ask(GoodImage(3));
  Ask(GoodImage(4));
  Ask(GoodImage(3));
  EXPECT_THAT(localizer_->seeds, testing::ElementsAre(0xf3U, 0xf4U, 0xf3U));
}

struct NoPoseCase {
  std::string name;
  CameraPoseStatus status;
  std::int32_t expected;
  std::string message;
};

class NoPoseTest : public InferenceNodeTest, public testing::WithParamInterface<NoPoseCase> {};

TEST_P(NoPoseTest, SaysWhyThereIsNone) {
  localizer_->answer.pose.status = GetParam().status;
  localizer_->answer.pose.confidence = 0.0125;
  localizer_->answer.region = -1;
  const camera_pose_t answer = Ask(GoodImage());
  EXPECT_EQ(answer.status, GetParam().expected);
  EXPECT_THAT(answer.message, HasSubstr(GetParam().message));
  EXPECT_EQ(answer.region, -1);
  EXPECT_THAT(Eigen::Vector3d(answer.pos), IsNear(Eigen::Vector3d(0.0, 0.0, 0.0), 0.0));
  EXPECT_EQ(node_->counters().poses, 0);
}

INSTANTIATE_TEST_SUITE_P(Reasons,
                         NoPoseTest,
                         testing::Values(NoPoseCase{"NoHypothesis",
                                                    CameraPoseStatus::kNoHypothesis,
                                                    camera_pose_t::STATUS_NO_HYPOTHESIS,
                                                    "four of 1200 scene coordinates"},
                                         NoPoseCase{"LowConfidence",
                                                    CameraPoseStatus::kLowConfidence,
                                                    camera_pose_t::STATUS_LOW_CONFIDENCE,
                                                    "confidence 0.013, 900 of 1200"},
                                         NoPoseCase{"Degenerate",
                                                    CameraPoseStatus::kDegenerate,
                                                    camera_pose_t::STATUS_DEGENERATE,
                                                    "do not determine a pose"}),
                         [](const auto& instance) { return instance.param.name; });

TEST_F(InferenceNodeTest, SaysThatAnImageIsNoJpeg) {
  const camera_pose_t answer = Ask(MakeImage({1, 2, 3, 4}));
  EXPECT_EQ(answer.status, camera_pose_t::STATUS_BAD_IMAGE);
  EXPECT_THAT(answer.message, HasSubstr("JPEG"));
  EXPECT_EQ(answer.image_seq, 3);
  EXPECT_EQ(node_->counters().bad, 1);
}

TEST_F(InferenceNodeTest, SaysThatAnImageIsCutShort) {
  std::vector<std::uint8_t> jpeg = MakeTestJpeg(kWidth, kHeight);
  jpeg.resize(jpeg.size() / 2);
  EXPECT_EQ(Ask(MakeImage(jpeg)).status, camera_pose_t::STATUS_BAD_IMAGE);
  EXPECT_EQ(Ask(MakeImage({})).status, camera_pose_t::STATUS_BAD_IMAGE);
  EXPECT_EQ(node_->counters().bad, 2);
  EXPECT_THAT(localizer_->seeds, testing::IsEmpty());
}

TEST_F(InferenceNodeTest, RefusesAnImageOfAnotherSizeThanTheMaps) {
  const camera_pose_t answer = Ask(MakeImage(MakeTestJpeg(640, 480)));
  EXPECT_EQ(answer.status, camera_pose_t::STATUS_WRONG_SIZE);
  EXPECT_EQ(answer.message, "the image is 640 x 480 px, the map is for 320 x 240 px");
  EXPECT_EQ(node_->counters().wrong_size, 1);
}

TEST_F(InferenceNodeTest, RefusesRawImages) {
  image_t image = GoodImage();
  image.pixelformat = 0x59455247;
  const camera_pose_t answer = Ask(image);
  EXPECT_EQ(answer.status, camera_pose_t::STATUS_BAD_IMAGE);
  EXPECT_THAT(answer.message, HasSubstr("pixel format 0x59455247, must be MJPG"));
}

TEST_F(InferenceNodeTest, RefusesAnImageWithoutTime) {
  image_t image = GoodImage();
  image.metadata.clear();
  image.nmetadata = 0;
  const camera_pose_t answer = Ask(image);
  EXPECT_EQ(answer.status, camera_pose_t::STATUS_BAD_IMAGE);
  EXPECT_THAT(answer.message, HasSubstr("mono_ns"));
}

TEST_F(InferenceNodeTest, PassesOverImagesThatAreTooOld) {
  now_.monotonic = FromNanoseconds(kImageTimeNs) + std::chrono::milliseconds(501);
  node_->Handle("front", GoodImage());
  EXPECT_EQ(bus_.HandlePending(), 0);
  EXPECT_EQ(node_->counters().too_old, 1);
  EXPECT_THAT(localizer_->seeds, testing::IsEmpty());
}

TEST(InferenceNodeAgeTest, TakesImagesOfAnyAgeWithoutALimit) {
  InProcessBus bus;
  InferenceConfig config;
  config.max_image_age_ms = 0;
  InferenceNode node(config, std::make_unique<FakeLocalizer>(), {}, bus, kRunId, [] {
    return ClockReading{.monotonic = FromNanoseconds(kImageTimeNs) + std::chrono::hours(24 * 365),
                        .realtime_us = 0};
  });
  node.Handle("front", MakeImage(MakeTestJpeg(kWidth, kHeight)));
  EXPECT_EQ(node.counters().too_old, 0);
  EXPECT_EQ(bus.HandlePending(), 1);
}

TEST_F(InferenceNodeTest, WarnsWhileThereAreNoImages) {
  EXPECT_EQ(node_->Status(now_).level, status_t::WARNING);
  EXPECT_EQ(node_->Status(now_).message, "no image yet");
  Ask(GoodImage());
  EXPECT_EQ(node_->Status(now_).level, status_t::OK);
  now_.monotonic += std::chrono::milliseconds(2500);
  EXPECT_EQ(node_->Status(now_).message, "no image for 2.5 s");
}

TEST_F(InferenceNodeTest, WarnsWhenPosesStayOut) {
  Ask(GoodImage());
  for (int i = 0; i < 5; ++i) {
    image_t image = MakeImage({1, 2, 3});
    now_.monotonic += std::chrono::milliseconds(500);
    SetImageMetadata({.mono_ns = ToNanoseconds(now_.monotonic), .seq = i, .run_id = 9}, image);
    Ask(image);
  }
  EXPECT_EQ(node_->Status(now_).level, status_t::WARNING);
  EXPECT_THAT(node_->Status(now_).message, HasSubstr("no pose for 2.5 s: "));
}

TEST_F(InferenceNodeTest, ReportsCountersAndLatencies) {
  Ask(GoodImage());
  Ask(MakeImage({}));
  const NodeStatus status = node_->Status(now_);
  const auto value = [&](const std::string& name) {
    for (const StatusValue& entry : status.values) {
      if (entry.name == name) return entry.value;
    }
    ADD_FAILURE() << "no " << name;
    return -1.0;
  };
  EXPECT_EQ(value("images"), 2.0);
  EXPECT_EQ(value("images_bad"), 1.0);
  EXPECT_EQ(value("poses"), 1.0);
  EXPECT_DOUBLE_EQ(value("image_to_pose_p99_ms"), 30.0);
}

/// A real map behind the node, driven through the bus.
std::vector<std::uint8_t> BytesOfAnAnswer() {
  const GrayImage image = MakeTexturedImage(kWidth, kHeight, 1);
  const std::vector<std::uint8_t> jpeg = EncodeGrayToJpeg(image, 100).value();
  const GrayImage decoded = DecodeJpegToGray(jpeg).value();
  InProcessBus bus;
  InferenceNode node(
      {},
      MapLocalizer::Create(MakeOneImageMap(decoded, SmallCamera(), kPose), {}).value(),
      std::map<std::string, Pose3>{},
      bus,
      kRunId,
      [] { return ClockReading{.monotonic = FromNanoseconds(kImageTimeNs), .realtime_us = 0}; });
  std::vector<std::uint8_t> answer;
  bus.SubscribeRaw("CAMERA_POSE", [&](const std::string&, std::span<const std::uint8_t> bytes) {
    answer.assign(bytes.begin(), bytes.end());
  });
  bus.Subscribe<image_t>(ImageChannel("front"), Delivery::kNewest, [&](const image_t& message) {
    node.Handle("front", message);
  });

  image_t message{};
  message.pixelformat = 0x47504A4D;
  message.size = static_cast<std::int32_t>(jpeg.size());
  message.data = jpeg;
  message.width = kWidth;
  message.height = kHeight;
  SetImageMetadata({.mono_ns = kImageTimeNs, .seq = 12, .run_id = 9}, message);
  EXPECT_TRUE(bus.Publish(ImageChannel("front"), message));
  bus.HandlePending();
  return answer;
}

TEST(InferenceChainTest, LocalisesAnImageMessageWithARealMap) {
  const auto answer = DecodeBounded<camera_pose_t>(BytesOfAnAnswer());
  ASSERT_TRUE(answer.has_value());
  ASSERT_EQ(answer->status, camera_pose_t::STATUS_OK) << answer->message;
  EXPECT_THAT(Eigen::Vector3d(answer->pos), IsNear(kPose.translation(), 0.1));
  EXPECT_GT(answer->confidence, 0.9);
}

TEST(InferenceChainTest, GivesTheSameBytesTwice) {
  EXPECT_EQ(BytesOfAnAnswer(), BytesOfAnAnswer());
}

localization_t LocalizationAt(std::int64_t mono_ns) {
  localization_t localization{};
  localization.status = localization_t::OK;
  localization.mono_ns = mono_ns;
  localization.x_WB_m = 10.0;
  localization.y_WB_m = 20.0;
  localization.yaw_WB_rad = 0.5;
  localization.speed_mps = 8.0;
  Eigen::Map<Eigen::Matrix3d>(localization.covariance).diagonal() << 0.09, 0.16, 0.0004;
  return localization;
}

TEST_F(InferenceNodeTest, LooksFirstWhereTheLocalizationExpectsTheCamera) {
  Ask(GoodImage(1));
  node_->Handle(LocalizationAt(kImageTimeNs - 100'000'000));
  Ask(GoodImage(2));
  ASSERT_EQ(localizer_->priors.size(), 2U);
  EXPECT_FALSE(localizer_->priors[0]);
  ASSERT_TRUE(localizer_->priors[1]);
  const CameraPrior& prior = *localizer_->priors[1];
  // 0.8 m of travel since then, and 1.2 m to the camera.
  const Eigen::Vector3d expected(10.0 + 2.0 * std::cos(0.5), 20.0 + 2.0 * std::sin(0.5), 1.5);
  EXPECT_LT((prior.X_WC.translation() - expected).norm(), 1e-9);
  EXPECT_NEAR(prior.X_WC.R().col(2).y(), std::sin(0.5), 1e-9) << "it looks ahead";
  EXPECT_NEAR(prior.sigma_m, 0.5, 1e-12);
  EXPECT_NEAR(prior.sigma_rad, 0.02, 1e-12);
  EXPECT_EQ(node_->counters().priors, 1);
}

TEST_F(InferenceNodeTest, ExpectsNothingWhereTheLocalizationSaysNothingOfTheImagesTime) {
  std::vector<localization_t> useless(5, LocalizationAt(kImageTimeNs));
  useless[0].mono_ns = kImageTimeNs - 2'100'000'000;
  useless[1].mono_ns = kImageTimeNs + 2'100'000'000;
  useless[2].status = localization_t::LOST;
  useless[3].status = localization_t::UNINITIALISED;
  useless[4].x_WB_m = std::numeric_limits<double>::quiet_NaN();
  for (const localization_t& localization : useless) {
    node_->Handle(LocalizationAt(kImageTimeNs));
    node_->Handle(localization);
    Ask(GoodImage());
    EXPECT_FALSE(localizer_->priors.back());
  }
}

}  // namespace
}  // namespace relocd
