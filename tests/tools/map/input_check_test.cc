#include "input_check.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <numeric>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>

#include "camera/measured_depth.h"
#include "camera/pinhole_camera.h"
#include "core/file.h"
#include "depth_file.h"
#include "support/random.h"
#include "wall_drive.h"

namespace relocd {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

std::string Text(const InputCheck& check) {
  return FormatInputCheck(check, "drive");
}

InputCheck Check(WallDrive& drive) {
  return CheckInput(drive.dataset(), {.threads = 1});
}

TEST(InputCheckTest, AGoodDriveIsGood) {
  WallDrive drive;
  const InputCheck check = Check(drive);
  EXPECT_THAT(check.findings, IsEmpty()) << Text(check);
  EXPECT_EQ(check.summary.frames, 44U);
  EXPECT_GT(check.summary.fitting_share, 0.95);
  EXPECT_NEAR(check.summary.focal_factor.value_or(0.0), 1.0, 0.02);
  EXPECT_NEAR(check.summary.depth_m, 9.0, 1.5);
}

TEST(InputCheckTest, TheResultDoesNotDependOnThreads) {
  WallDrive drive;
  EXPECT_EQ(Text(CheckInput(drive.dataset(), {.threads = 1})),
            Text(CheckInput(drive.dataset(), {.threads = 3})));
}

/// Ways to write poses wrongly, and what must be said of them.
struct PoseDamage {
  const char* name;
  std::function<void(Dataset&)> damage;
  const char* about;
  const char* said;
};

void ChangeAll(Dataset& dataset, const std::function<Pose3(const Pose3&)>& change) {
  for (DatasetFrame& frame : dataset.frames)
    frame.X_WC = change(frame.X_WC);
}

void Reorder(Dataset& dataset, const std::function<std::size_t(std::size_t)>& row_of) {
  const std::vector<DatasetFrame> frames = dataset.frames;
  for (std::size_t i = 0; i < frames.size(); ++i)
    dataset.frames[i].X_WC = frames[row_of(i)].X_WC;
}

const Eigen::Matrix3d kMirrorX = Eigen::Vector3d(-1.0, 1.0, 1.0).asDiagonal();

const PoseDamage kPoseDamages[] = {
    {"WorldToCamera",
     [](Dataset& d) { ChangeAll(d, [](const Pose3& X) { return X.Inverse(); }); },
     "poses",
     "if the poses are world to camera: write poses_tum.txt as camera to world"},
    {"OpenGlAxes",
     [](Dataset& d) {
       const Pose3 X_CG(Eigen::Matrix3d(Eigen::Vector3d(1.0, -1.0, -1.0).asDiagonal()), {0, 0, 0});
       ChangeAll(d, [&](const Pose3& X) { return X * X_CG; });
     },
     "poses",
     "if the camera's axes are x right, y up, z back"},
    {"AxesOfTheBody",
     [](Dataset& d) {
       Eigen::Matrix3d R_CB;  // x forward, y left, z up
       R_CB << 0, -1, 0, 0, 0, -1, 1, 0, 0;
       ChangeAll(d, [&](const Pose3& X) { return X * Pose3(R_CB, Eigen::Vector3d::Zero()); });
     },
     "poses",
     "if the camera's axes are x forward, y left, z up"},
    {"WorldToCameraOfOpenGl",
     [](Dataset& d) {
       const Pose3 X_CG(Eigen::Matrix3d(Eigen::Vector3d(1.0, -1.0, -1.0).asDiagonal()), {0, 0, 0});
       ChangeAll(d, [&](const Pose3& X) { return (X * X_CG).Inverse(); });
     },
     "poses",
     "if the poses are world to camera, and the camera's axes are x right, y up, z back"},
    {"MirroredWorld",
     [](Dataset& d) {
       ChangeAll(d, [](const Pose3& X) {
         return Pose3(Eigen::Matrix3d(kMirrorX * X.R() * kMirrorX), kMirrorX * X.translation());
       });
     },
     "poses",
     "if the images or the world are mirrored"},
    {"PositionsMirrored",
     [](Dataset& d) {
       ChangeAll(d, [](const Pose3& X) { return Pose3(X.rotation(), kMirrorX * X.translation()); });
     },
     "poses",
     "if the positions fit as (-x, y, z) beside rotations as they are"},
    {"PositionsSwapped",
     [](Dataset& d) {
       ChangeAll(d, [](const Pose3& X) {
         const Eigen::Vector3d& p = X.translation();
         return Pose3(X.rotation(), {p.z(), p.x(), p.y()});
       });
     },
     "poses",
     "if the positions fit as (y, z, x) beside rotations as they are"},
    {"ScalarFirst",
     [](Dataset& d) {
       ChangeAll(d, [](const Pose3& X) {  // qw qx qy qz read as qx qy qz qw
         const Eigen::Quaterniond& q = X.rotation();
         return Pose3(Eigen::Quaterniond(q.z(), q.w(), q.x(), q.y()), X.translation());
       });
     },
     "poses",
     "if the quaternions begin with qw"},
    {"Reversed",
     [](Dataset& d) { Reorder(d, [&](std::size_t i) { return d.frames.size() - 1 - i; }); },
     "poses",
     "if the rows are in the order from last to first"},
    {"Shuffled",
     [](Dataset& d) {
       std::vector<std::size_t> order(d.frames.size());
       std::iota(order.begin(), order.end(), 0U);
       TestRandom random(3);
       std::shuffle(order.begin(), order.end(), random.engine());
       Reorder(d, [&](std::size_t i) { return order[i]; });
     },
     "poses",
     "no other reading of them fits better: are the rows of poses_tum.txt those of the images"},
    {"OfAnotherDrive",
     [](Dataset& d) {
       for (std::size_t i = 0; i < d.frames.size(); ++i) {
         const auto at = static_cast<double>(i);
         d.frames[i].X_WC = Pose3(
             RotationFromRollPitchYaw(0.1 * std::sin(0.5 * at), 0.5 * std::cos(0.21 * at), 0.0),
             {0.1 * std::cos(0.3 * at), 0.0, 0.3 * at});
       }
     },
     "poses",
     "(first images/00.jpg)"},
    {"ThreeRowsLate",
     [](Dataset& d) { Reorder(d, [&](std::size_t i) { return i < 3 ? 0 : i - 3; }); },
     "time",
     "if the images were taken 3 rows after their poses: put each pose beside the image"},
    {"FocalTooLong",
     [](Dataset& d) {
       d.intrinsics.fx *= 1.5;
       d.intrinsics.fy *= 1.5;
     },
     "focal",
     "times the focal length (330.0 px in intrinsics.txt): calibrate the camera"},
};

TEST(InputCheckTest, RefusesPosesThatContradictTheImagesWithTheReason) {
  WallDrive drive;
  for (const PoseDamage& damage : kPoseDamages) {
    SCOPED_TRACE(damage.name);
    Dataset dataset = drive.dataset();
    damage.damage(dataset);
    const InputCheck check = CheckInput(dataset, {.threads = 1});
    ASSERT_TRUE(check.IsRefused()) << Text(check);
    EXPECT_EQ(check.findings.front().about, damage.about) << Text(check);
    EXPECT_THAT(check.findings.front().message, HasSubstr(damage.said));
  }
}

TEST(InputCheckTest, FindsTheFocalLength) {
  WallDrive drive;
  for (const double factor : {0.75, 0.93, 1.08, 1.3}) {
    Dataset dataset = drive.dataset();
    dataset.intrinsics.fx *= factor;
    dataset.intrinsics.fy *= factor;
    const InputCheck check = CheckInput(dataset, {.threads = 1});
    ASSERT_THAT(check.findings, Not(IsEmpty())) << factor << "\n" << Text(check);
    EXPECT_EQ(check.findings.front().about, "focal") << Text(check);
    EXPECT_THAT(check.findings.front().message,
                HasSubstr(fmt::format("({:.1f} px in intrinsics.txt)", 220.0 * factor)));
    if (check.summary.focal_factor) {
      EXPECT_NEAR(*check.summary.focal_factor * factor, 1.0, 0.03);
    }
  }
}

TEST(InputCheckTest, MirroredImagesAreToldAsSuch) {
  WallDrive drive;
  drive.ChangeImages(0, WallDrive::kFrames, [](GrayImage image) {
    for (int v = 0; v < image.height; ++v) {
      const auto row = image.pixels.begin() + v * image.width;
      std::reverse(row, row + image.width);
    }
    return image;
  });
  const InputCheck check = Check(drive);
  ASSERT_TRUE(check.IsRefused()) << Text(check);
  EXPECT_THAT(check.findings.front().message,
              HasSubstr("the images or the world are mirrored (the camera's axes fit as x left, y "
                        "down, z forward)"));
}

TEST(InputCheckTest, NamesThePosesThatBelongElsewhere) {
  WallDrive drive;
  std::swap(drive.dataset().frames[12].X_WC, drive.dataset().frames[30].X_WC);
  const InputCheck check = Check(drive);
  EXPECT_FALSE(check.IsRefused()) << Text(check);
  const auto found =
      std::find_if(check.findings.begin(), check.findings.end(), [](const InputFinding& finding) {
        return finding.about == "poses";
      });
  ASSERT_NE(found, check.findings.end()) << Text(check);
  EXPECT_THAT(
      found->message,
      AllOf(HasSubstr("6 of 44 poses contradict their images (images/11.jpg to images/13.jpg, "
                      "images/29.jpg to images/31.jpg)"),
            HasSubstr("mend them, or take their rows out")));
}

TEST(InputCheckTest, WarnsOfAScaleThatIsNotMetres) {
  WallDrive drive;
  for (const double scale : {1000.0, 100.0, 0.01, 0.001}) {
    Dataset dataset = drive.dataset();
    ChangeAll(dataset,
              [&](const Pose3& X) { return Pose3(X.rotation(), scale * X.translation()); });
    EXPECT_THAT(Text(CheckInput(dataset, {.threads = 1})), HasSubstr("are the positions in metres"))
        << scale;
  }
}

TEST(InputCheckTest, NamesBlurredImages) {
  WallDrive drive;
  const auto smear = [](const GrayImage& image) {  // by 25 px, as a turn at night does
    GrayImage result = image;
    const cv::Mat sharp(image.height, image.width, CV_8UC1, result.pixels.data());
    cv::Mat smeared;
    cv::blur(sharp, smeared, {25, 1});
    smeared.copyTo(sharp);
    return result;
  };
  drive.ChangeImages(20, 22, smear);
  const InputCheck check = Check(drive);
  EXPECT_FALSE(check.IsRefused());
  EXPECT_THAT(Text(check),
              HasSubstr("warning: blur: 2 of 44 images are blurred more than those around them "
                        "(images/20.jpg, images/21.jpg)"));
}

TEST(InputCheckTest, WarnsOfALensOutOfFocus) {
  WallDrive drive;
  drive.ChangeImages(0, WallDrive::kFrames, [](const GrayImage& image) {  // a sigma of 3 px
    cv::Mat blurred;
    GrayImage result = image;
    const cv::Mat sharp(image.height, image.width, CV_8UC1, result.pixels.data());
    cv::GaussianBlur(sharp, blurred, {}, 3.0);
    blurred.copyTo(sharp);
    return result;
  });
  EXPECT_THAT(Text(Check(drive)),
              HasSubstr("warning: blur: the images are blurred throughout, by"));
}

TEST(InputCheckTest, NamesImagesThatAreTooDarkOrTooBright) {
  WallDrive drive;
  drive.ChangeImages(3, 5, [](GrayImage image) {
    for (auto& pixel : image.pixels)
      pixel = static_cast<std::uint8_t>(pixel / 8);
    return image;
  });
  drive.ChangeImages(40, 41, [](GrayImage image) {
    for (auto& pixel : image.pixels)
      pixel = static_cast<std::uint8_t>(220 + pixel / 8);
    return image;
  });
  const std::string text = Text(Check(drive));
  EXPECT_THAT(
      text, HasSubstr("exposure: 2 of 44 images are nearly black (images/03.jpg, images/04.jpg)"));
  EXPECT_THAT(text, HasSubstr("exposure: 1 of 44 images are nearly white (images/40.jpg)"));
  EXPECT_THAT(text, HasSubstr("are much brighter or darker than the image before"));
}

TEST(InputCheckTest, NamesImagesAndPosesThatHang) {
  WallDrive drive;
  const GrayImage stuck = drive.Image(9);
  for (std::size_t i = 10; i < 13; ++i)
    drive.WriteImage(i, stuck);
  for (std::size_t i = 31; i < 33; ++i)
    drive.dataset().frames[i].X_WC = drive.dataset().frames[30].X_WC;
  const std::string text = Text(Check(drive));
  EXPECT_THAT(text,
              HasSubstr("duplicates: 2 of 44 images are copies of earlier ones, byte for byte "
                        "(images/11.jpg, images/12.jpg)"));
  EXPECT_THAT(text,
              HasSubstr("images: 3 of 44 images show what the image before shows although the "
                        "poses travel (images/10.jpg to images/12.jpg)"));
  EXPECT_THAT(text,
              HasSubstr("poses: 2 of 44 images move although their pose is that of the image "
                        "before (images/31.jpg, images/32.jpg)"));
}

TEST(InputCheckTest, NamesGaps) {
  WallDrive drive([](double i) { return WallDrive::PoseAt(i < 20 ? i : i + 12); }, 32);
  for (std::size_t i = 0; i < 32; ++i)
    drive.dataset().frames[i].index = static_cast<int>(i);
  const InputCheck check = Check(drive);
  EXPECT_FALSE(check.IsRefused()) << Text(check);
  EXPECT_THAT(Text(check), HasSubstr("from images/19.jpg to images/20.jpg), where 0.2"));
}

TEST(InputCheckTest, ImagesThatASplitLeavesOutAreNoGap) {
  WallDrive drive;
  std::erase_if(drive.dataset().frames,
                [](const DatasetFrame& frame) { return frame.index % 5 == 2; });
  const InputCheck check = Check(drive);
  EXPECT_FALSE(check.IsRefused()) << Text(check);
  EXPECT_THAT(Text(check), Not(HasSubstr("gaps")));
}

TEST(InputCheckTest, RefusesImagesThatAreMissingOrBrokenOrOfAnotherSize) {
  WallDrive drive;
  std::filesystem::remove(drive.dataset().frames[7].image_path);
  drive.folder().Write("images/08.jpg", "no image");
  drive.WriteImage(9, {.width = 120, .height = 80, .pixels = std::vector<std::uint8_t>(9600)});
  const InputCheck check = Check(drive);
  EXPECT_TRUE(check.IsRefused());
  EXPECT_THAT(
      Text(check),
      AllOf(HasSubstr("refused: images: 1 of 44 images are missing (images/07.jpg): copy them"),
            HasSubstr("refused: images: 1 of 44 images cannot be read (images/08.jpg: "),
            HasSubstr("refused: size: 1 of 44 images are (images/09.jpg) 120 x 80 pixels, must be "
                      "240 x 160 as intrinsics.txt says")));
}

/// Depth images of frames 0, 2, 4, ..., in this unit.
void AddDepth(WallDrive& drive, double units_per_m) {
  const PinholeCamera camera(WallScene::Intrinsics());
  std::filesystem::create_directories(drive.folder().path() + "/depth");
  for (DatasetFrame& frame : drive.dataset().frames) {
    if (frame.index % 2 == 1) continue;
    MeasuredDepth depth{.width = WallScene::kWidth, .height = WallScene::kHeight, .depth_mm = {}};
    for (int v = 0; v < WallScene::kHeight; ++v) {
      for (int u = 0; u < WallScene::kWidth; ++u) {
        const double depth_m = WallScene::Depth(frame.X_WC, *camera.Unproject({u, v}));
        depth.depth_mm.push_back(static_cast<std::uint16_t>(std::lround(units_per_m * depth_m)));
      }
    }
    frame.depth_path = fmt::format("{}/depth/{:02}.png", drive.folder().path(), frame.index);
    ASSERT_TRUE(WriteDepthFile(frame.depth_path, depth));
  }
}

TEST(InputCheckTest, HoldsDepthImagesAgainstThePoses) {
  WallDrive drive;
  AddDepth(drive, 1000.0);
  const InputCheck check = Check(drive);
  EXPECT_FALSE(check.IsRefused()) << Text(check);
  EXPECT_NEAR(check.summary.depth_factor.value_or(0.0), 1.0, 0.03);
  EXPECT_THAT(Text(check),
              AllOf(HasSubstr("times as far in the depth images"),
                    HasSubstr("warning: depth: 22 of 44 images have no depth image in depth/ "
                              "(images/01.jpg, images/03.jpg, ")));
}

TEST(InputCheckTest, RefusesDepthImagesInAnotherUnit) {
  WallDrive drive;
  AddDepth(drive, 5000.0);
  const InputCheck check = Check(drive);
  EXPECT_NEAR(check.summary.depth_factor.value_or(0.0), 5.0, 0.15);
  EXPECT_THAT(Text(check), HasSubstr("times as far in the depth images as by the poses, at "));
  EXPECT_TRUE(check.IsRefused());
}

TEST(InputCheckTest, RefusesDepthImagesThatAreNone) {
  WallDrive drive;
  AddDepth(drive, 1000.0);
  drive.folder().Write("depth/00.png", "no image");
  EXPECT_THAT(
      Text(Check(drive)),
      AllOf(HasSubstr("refused: depth: "),
            HasSubstr("/depth/00.png: cannot be read as an image, must be a PNG file of 240 "
                      "x 160 pixels with one channel of 16 bits, depth in mm")));
  drive.folder().Write("depth/00.png", ReadFile(drive.dataset().frames[0].image_path).value());
  EXPECT_THAT(Text(Check(drive)), HasSubstr("/depth/00.png: has 1 channels of 8 bits, must be"));
}

TEST(InputCheckTest, RefusesTooFewFrames) {
  WallDrive drive(5);
  EXPECT_THAT(Text(Check(drive)),
              HasSubstr("refused: frames: 5 training frames, must be at least 8"));
}

TEST(InputCheckTest, RefusesACameraThatOnlyTurns) {
  WallDrive still([](double i) { return Pose3(WallDrive::PoseAt(i).rotation(), {0, 0, 0}); }, 44);
  EXPECT_THAT(Text(Check(still)), HasSubstr("refused: route: the camera travels 0.000 m"));

  WallDrive shaking(
      [](double i) {
        const double shake = std::fmod(i, 2.0) < 0.5 ? 0.0075 : -0.0075;
        return Pose3(WallDrive::PoseAt(i).rotation(), {shake, 0.0, 0.0});
      },
      44);
  const InputCheck check = Check(shaking);
  EXPECT_TRUE(check.IsRefused());
  EXPECT_THAT(
      Text(check),
      AllOf(HasSubstr("refused: parallax: things move by"), HasSubstr("drive, do not only turn")));
}

}  // namespace
}  // namespace relocd
