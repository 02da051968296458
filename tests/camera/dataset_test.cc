#include "camera/dataset.h"

#include <random>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "camera/jpeg.h"
#include "support/eigen_matchers.h"
#include "support/shared_data.h"
#include "support/temporary_folder.h"

namespace relocd {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

/// A data set of two frames, whose files a test can spoil.
class DatasetTest : public testing::Test {
 protected:
  DatasetTest() {
    folder_.Write("frames.txt", "# the images\nimages/a.jpg\n\nimages/b.jpg\n");
    folder_.Write("poses_tum.txt", "# time_s ...\n1.5 1 2 3 0 0 0 1\n1.75 4 5 6 0 0 1 0\n");
    folder_.Write("intrinsics.txt", "# fx ...\n500 501 320 240 640 480\n");
  }

  [[nodiscard]] std::string ErrorOfReading() const {
    const auto dataset = ReadDataset(folder_.path());
    return dataset ? "no error" : dataset.error().message;
  }

  TemporaryFolder folder_;
};

TEST_F(DatasetTest, ReadsFramesInOrder) {
  folder_.Write("frames.txt", "# the images\nimages/a.jpg\n\nimages/b#2.jpg  # the second\n");
  const auto dataset = ReadDataset(folder_.path());
  ASSERT_TRUE(dataset) << dataset.error().message;
  ASSERT_EQ(dataset->frames.size(), 2U);
  EXPECT_EQ(dataset->intrinsics.width, 640);
  EXPECT_EQ(dataset->frames[0].image_path, folder_.path() + "/images/a.jpg");
  EXPECT_EQ(dataset->frames[1].image_path, folder_.path() + "/images/b#2.jpg");
  EXPECT_EQ(dataset->frames[1].index, 1);
  EXPECT_EQ(dataset->frames[1].time_ns, 1'750'000'000);
  EXPECT_THAT(dataset->frames[1].X_WC.translation(), IsNear(Eigen::Vector3d(4, 5, 6), 0.0));
}

TEST_F(DatasetTest, SaysWhichFileIsMissing) {
  const auto dataset = ReadDataset(folder_.path() + "/nowhere");
  ASSERT_FALSE(dataset);
  EXPECT_EQ(dataset.error().kind, ErrorKind::kUnavailable);
  EXPECT_THAT(dataset.error().message, HasSubstr("/nowhere/frames.txt"));
}

TEST_F(DatasetTest, NeedsAPoseForEachImage) {
  folder_.Write("poses_tum.txt", "1.5 1 2 3 0 0 0 1\n");
  EXPECT_EQ(ErrorOfReading(),
            folder_.path() + "/poses_tum.txt: has 1 poses, must have 2: one for each image of " +
                folder_.path() + "/frames.txt");
}

TEST_F(DatasetTest, NeedsAnImage) {
  folder_.Write("frames.txt", "# none\n");
  EXPECT_EQ(ErrorOfReading(),
            folder_.path() + "/frames.txt: has no images, must have at least one");
}

TEST_F(DatasetTest, NamesTheLineOfABadPose) {
  folder_.Write("poses_tum.txt", "1.5 1 2 3 0 0 0 1\n1.25 1 2 3 0 0 0 1\n");
  EXPECT_THAT(ErrorOfReading(), StartsWith(folder_.path() + "/poses_tum.txt: line 2: the time is"));
}

TEST(ParseIntrinsicsTest, TakesFourOrFiveDistortionCoefficients) {
  const auto four = ParseIntrinsics("500 501 320 240 640 480 0.1 0.2 0.3 0.4", "i.txt");
  ASSERT_TRUE(four);
  EXPECT_THAT(four->distortion, testing::ElementsAre(0.1, 0.2, 0.3, 0.4, 0.0));
  const auto five = ParseIntrinsics("500 501 320 240 640 480 0.1 0.2 0.3 0.4 0.5 # k3", "i.txt");
  ASSERT_TRUE(five);
  EXPECT_THAT(five->distortion, testing::ElementsAre(0.1, 0.2, 0.3, 0.4, 0.5));
}

struct BadText {
  std::string name;
  std::string text;
  std::string message;
};

class ParseIntrinsicsErrorTest : public testing::TestWithParam<BadText> {};

TEST_P(ParseIntrinsicsErrorTest, SaysWhatIsWrong) {
  const auto intrinsics = ParseIntrinsics(GetParam().text, "i.txt");
  ASSERT_FALSE(intrinsics);
  EXPECT_EQ(intrinsics.error().kind, ErrorKind::kInvalidInput);
  EXPECT_EQ(intrinsics.error().message, GetParam().message);
}

INSTANTIATE_TEST_SUITE_P(
    All,
    ParseIntrinsicsErrorTest,
    testing::Values(
        BadText{"Empty",
                "# nothing\n",
                "i.txt: has 0 lines, must have one: 'fx fy cx cy width height [k1 k2 p1 p2 [k3]]'"},
        BadText{"TooFew",
                "\n500 500 320 240 640\n",
                "i.txt: line 2: is '500 500 320 240 640', must be 'fx fy cx cy width height [k1 k2 "
                "p1 p2 [k3]]'"},
        BadText{"NoNumber",
                "500 500 320 240 640 x",
                "i.txt: line 1: is '500 500 320 240 640 x', must be 'fx fy cx cy width height [k1 "
                "k2 p1 p2 [k3]]'"},
        BadText{"HalfAPixel",
                "500 500 320 240 640.5 480",
                "i.txt: line 1: is '500 500 320 240 640.5 480', must be 'fx fy cx cy width height "
                "[k1 k2 p1 p2 [k3]]'"},
        BadText{"NegativeFocalLength",
                "-500 500 320 240 640 480",
                "i.txt: line 1: fx is -500, must be above 0"}),
    [](const auto& instance) { return instance.param.name; });

TEST(ParseSplitTest, ReadsTheParts) {
  const auto split = ParseSplit("# index file part\n0 images/a.jpg train\n7 b c.jpg test\n", "s");
  ASSERT_TRUE(split) << split.error().message;
  EXPECT_THAT(*split,
              testing::ElementsAre(testing::Pair(0, SplitPart::kTrain),
                                   testing::Pair(7, SplitPart::kTest)));
}

class ParseSplitErrorTest : public testing::TestWithParam<BadText> {};

TEST_P(ParseSplitErrorTest, SaysWhatIsWrong) {
  const auto split = ParseSplit(GetParam().text, "s.txt");
  ASSERT_FALSE(split);
  EXPECT_EQ(split.error().kind, ErrorKind::kInvalidInput);
  EXPECT_EQ(split.error().message, GetParam().message);
}

INSTANTIATE_TEST_SUITE_P(
    All,
    ParseSplitErrorTest,
    testing::Values(
        BadText{"Part",
                "0 a.jpg train\n1 b.jpg validate\n",
                "s.txt: line 2: is '1 b.jpg validate', must be 'index file train|test'"},
        BadText{"NoFile", "3 test", "s.txt: line 1: is '3 test', must be 'index file train|test'"},
        BadText{"Negative",
                "-1 a.jpg test",
                "s.txt: line 1: is '-1 a.jpg test', must be 'index file train|test'"},
        BadText{"Huge",
                "99999999999 a.jpg test",
                "s.txt: line 1: is '99999999999 a.jpg test', must be 'index file train|test'"},
        BadText{"Twice",
                "1 a.jpg test\n1 b.jpg train",
                "s.txt: line 2: index 1 came before, must be new"}),
    [](const auto& instance) { return instance.param.name; });

TEST(ParseSplitTest, AnyTextIsAnErrorOrASplit) {
  const std::string split = "0 images/a.jpg train\n1 images/b.jpg test  # comment\n";
  const std::string intrinsics = "500 501 320 240 640 480 0.1 0.2 0.3 0.4 0.5\n";
  std::mt19937 engine(9);  // the same texts in every run
  int refused = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    for (std::string text : {split, intrinsics}) {
      std::uniform_int_distribution<std::size_t> position(0, text.size() - 1);
      for (int change = 0; change <= trial % 4; ++change)
        text[position(engine)] = static_cast<char>(engine() & 0xFFU);
      if (!ParseSplit(text, "s.txt")) ++refused;
      if (!ParseIntrinsics(text, "i.txt")) ++refused;
    }
  }
  EXPECT_GT(refused, 4000);  // each text is at least not of the other form
}

TEST(RealDatasetTest, KittiIsReadWhole) {
  const std::string folder = SharedData("kitti00_head");
  if (folder.empty()) GTEST_SKIP() << SharedDataReason("kitti00_head");
  const auto dataset = ReadDataset(folder);
  ASSERT_TRUE(dataset) << dataset.error().message;
  EXPECT_EQ(dataset->frames.size(), 1018U);
  EXPECT_EQ(dataset->intrinsics.width, 416);
  EXPECT_EQ(dataset->frames[1].time_ns, 103'736'000);
  const auto image = ReadGrayImage(dataset->frames.back().image_path);
  ASSERT_TRUE(image) << image.error().message;
  EXPECT_EQ(image->width, dataset->intrinsics.width);
  EXPECT_EQ(image->height, dataset->intrinsics.height);
  const auto split = ReadSplit(folder + "/split_every5.txt");
  ASSERT_TRUE(split) << split.error().message;
  EXPECT_EQ(split->size(), dataset->frames.size());
  EXPECT_EQ(split->at(2), SplitPart::kTest);
}

TEST(RealDatasetTest, LundHasDistortion) {
  const std::string folder = SharedData("lund_door");
  if (folder.empty()) GTEST_SKIP() << SharedDataReason("lund_door");
  const auto dataset = ReadDataset(folder);
  ASSERT_TRUE(dataset) << dataset.error().message;
  EXPECT_EQ(dataset->frames.size(), 12U);
  EXPECT_DOUBLE_EQ(dataset->intrinsics.distortion[0], -0.0336422);
  const auto image = ReadGrayImage(dataset->frames.front().image_path);
  ASSERT_TRUE(image) << image.error().message;
  EXPECT_EQ(image->height, 1936);
}

}  // namespace
}  // namespace relocd
