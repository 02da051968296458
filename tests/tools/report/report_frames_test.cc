#include "report_frames.h"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "made_drive.h"
#include "support/temporary_folder.h"

namespace relocd {
namespace {

using testing::HasSubstr;

/// Eleven images along the made drive, `aside_m` beside it, all of one gray.
std::string WriteDataset(const TemporaryFolder& folder, const std::string& name, double aside_m) {
  std::vector<unsigned char> bytes;
  cv::imencode(".jpg", cv::Mat(60, 800, CV_8UC1, cv::Scalar(90)), bytes);
  std::string frames;
  std::string poses;
  for (int k = 0; k < MadeDrive::kRows; ++k) {
    folder.Write(fmt::format("{}/{}.jpg", name, k),
                 {reinterpret_cast<char*>(bytes.data()), bytes.size()});
    frames += fmt::format("{}.jpg\n", k);
    poses += fmt::format("{} {} {} 1.5 0 0 0 1\n", k, 5.0 + aside_m, 2 + k);
  }
  folder.Write(name + "/frames.txt", frames);
  folder.Write(name + "/poses_tum.txt", poses);
  folder.Write(name + "/intrinsics.txt", "400 400 399.5 29.5 800 60\n");
  return folder.path() + "/" + name;
}

TEST(ReportFramesTest, AreSpacedEvenlyAndSayWhatTheTablesSay) {
  const TemporaryFolder folder;
  MadeDrive drive;
  drive.camera = MadeDrive::kPoseHeader;
  for (int k = 0; k < MadeDrive::kRows; ++k) {
    drive.camera +=
        k == 5 ? MadeDrive::NoPose(k, "low_confidence") : MadeDrive::Pose(k, 0.3, 0.1, "ok");
  }
  const auto report = drive.Report();
  ASSERT_TRUE(report);
  FrameSources sources;
  sources.dataset = WriteDataset(folder, "drive", 0.0);
  const auto frames = CollectFrames(*report, sources, 3);
  ASSERT_TRUE(frames) << frames.error().message;
  ASSERT_EQ(frames->size(), 3U);
  EXPECT_EQ((*frames)[0].time_s, 1.0);
  EXPECT_EQ((*frames)[1].time_s, 5.0);
  EXPECT_EQ((*frames)[2].time_s, 9.0);
  EXPECT_NEAR((*frames)[0].camera_error_m.value_or(-1.0), 0.3, 1e-9);
  EXPECT_NEAR((*frames)[0].fused_error_m.value_or(-1.0), 0.2, 1e-9);
  EXPECT_EQ((*frames)[0].confidence, 0.5);
  EXPECT_FALSE((*frames)[1].camera_error_m);
  EXPECT_EQ((*frames)[1].camera_status, "low_confidence");
  EXPECT_EQ((*frames)[1].status, "ok");
}

TEST(ReportFramesTest, ImagesAreMadeSmall) {
  const TemporaryFolder folder;
  const auto report = MadeDrive().Report();
  ASSERT_TRUE(report);
  FrameSources sources;
  sources.dataset = WriteDataset(folder, "drive", 0.0);
  const auto frames = CollectFrames(*report, sources, 1);
  ASSERT_TRUE(frames);
  const std::vector<unsigned char> bytes((*frames)[0].jpeg.begin(), (*frames)[0].jpeg.end());
  EXPECT_EQ(cv::imdecode(bytes, cv::IMREAD_COLOR).cols, 480);
}

TEST(ReportFramesTest, TheTeachDrivesImageIsThatOfTheSamePlace) {
  const TemporaryFolder folder;
  const auto report = MadeDrive().Report();
  ASSERT_TRUE(report);
  FrameSources sources;
  sources.dataset = WriteDataset(folder, "drive", 0.0);
  sources.teach_dataset = WriteDataset(folder, "teach", 0.75);
  auto frames = CollectFrames(*report, sources, 2);
  ASSERT_TRUE(frames) << frames.error().message;
  EXPECT_FALSE((*frames)[0].teach_jpeg.empty());
  EXPECT_NEAR((*frames)[0].teach_distance_m, 0.75, 1e-9);

  sources.teach_dataset = WriteDataset(folder, "elsewhere", 50.0);
  frames = CollectFrames(*report, sources, 2);
  ASSERT_TRUE(frames);
  EXPECT_TRUE((*frames)[0].teach_jpeg.empty());
}

TEST(ReportFramesTest, AnImageThatIsNotThereIsNamed) {
  const TemporaryFolder folder;
  const auto report = MadeDrive().Report();
  ASSERT_TRUE(report);
  FrameSources sources;
  sources.dataset = WriteDataset(folder, "drive", 0.0);
  folder.Write("drive/5.jpg", "no JPEG");
  const auto frames = CollectFrames(*report, sources, 1);
  ASSERT_FALSE(frames);
  EXPECT_EQ(frames.error().kind, ErrorKind::kInvalidInput);
  EXPECT_THAT(frames.error().message, HasSubstr("drive/5.jpg: is no image that can be decoded"));
}

TEST(ReportFramesTest, WithoutASourceThereAreNone) {
  const auto report = MadeDrive().Report();
  ASSERT_TRUE(report);
  const auto frames = CollectFrames(*report, {}, 8);
  ASSERT_TRUE(frames);
  EXPECT_TRUE(frames->empty());
}

}  // namespace
}  // namespace relocd
