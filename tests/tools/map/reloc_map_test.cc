#include <poll.h>
#include <sys/inotify.h>
#include <unistd.h>

#include <array>
#include <filesystem>
#include <string>
#include <string_view>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "camera/jpeg.h"
#include "core/csv.h"
#include "core/exit_code.h"
#include "core/file.h"
#include "scene_coordinates/wall_scene.h"
#include "supervision/child_process.h"
#include "support/temporary_folder.h"

namespace relocd {
namespace {

using testing::AllOf;
using testing::HasSubstr;

struct Outcome {
  int exit_code = -1;
  std::string output{};  ///< Of both stdout and stderr.
};

/// A drive along the wall as a data set, and the program run in it.
class RelocMapTest : public testing::Test {
 protected:
  void SetUp() override { WriteDrive(1.0); }

  /// @param stretch  of the poses: more than 1 makes the wall contradict them, but the route long.
  void WriteDrive(double stretch) const {
    constexpr int kFrames = 9;
    std::string frames;
    std::string poses;
    const auto drive = WallScene().Drive(kFrames);
    for (int index = 0; index < kFrames; ++index) {
      const TrainingImage& view = drive[static_cast<std::size_t>(index)];
      const auto jpeg = EncodeGrayToJpeg(view.image, 95).value();
      const std::string name = fmt::format("images/{:02}.jpg", index);
      folder_.Write(name, {reinterpret_cast<const char*>(jpeg.data()), jpeg.size()});
      frames += name + "\n";
      const Eigen::Vector3d t = stretch * view.X_WC.translation();
      poses += fmt::format("{:.1f} {} {} {} 0 0 0 1\n", 0.1 * index, t.x(), t.y(), t.z());
    }
    folder_.Write("frames.txt", frames);
    folder_.Write("poses_tum.txt", poses);
    folder_.Write("intrinsics.txt", "220 220 119.5 79.5 240 160\n");
  }

  [[nodiscard]] std::string Path(std::string_view name) const {
    return fmt::format("{}/{}", folder_.path(), name);
  }

  /// Starts the program, and kills it as soon as the file is there in the folder.
  void RunUntil(const std::string& arguments, const std::string& folder, std::string_view file) {
    std::filesystem::create_directories(Path(folder));
    const int watch = ::inotify_init1(IN_CLOEXEC);
    ASSERT_GE(::inotify_add_watch(watch, Path(folder).c_str(), IN_MOVED_TO), 0);
    const std::string command = fmt::format(
        "cd {} && exec {} {} >output.txt 2>&1", folder_.path(), RELOC_MAP_PROGRAM, arguments);
    auto process = ChildProcess::Start({.command = {"/bin/sh", "-c", command}});
    ASSERT_TRUE(process);
    std::string seen;
    while (seen.find(file) == std::string::npos) {
      std::array<pollfd, 2> waited = {pollfd{.fd = watch, .events = POLLIN, .revents = 0},
                                      pollfd{.fd = process->fd(), .events = POLLIN, .revents = 0}};
      ASSERT_GT(::poll(waited.data(), waited.size(), 200'000), 0);
      ASSERT_EQ(waited[1].revents, 0) << "it ended before " << file << " came";
      std::array<char, 4096> events{};
      const ssize_t size = ::read(watch, events.data(), events.size());
      ASSERT_GT(size, 0);
      seen.append(events.data(), static_cast<std::size_t>(size));
    }
    process->KillGroup();
    pollfd ended{.fd = process->fd(), .events = POLLIN, .revents = 0};
    ASSERT_EQ(::poll(&ended, 1, 10'000), 1);
    (void)process->Reap();
    ::close(watch);
  }

  [[nodiscard]] Outcome Run(const std::string& arguments) const {
    const std::string command = fmt::format(
        "cd {} && exec {} {} >output.txt 2>&1", folder_.path(), RELOC_MAP_PROGRAM, arguments);
    auto process = ChildProcess::Start({.command = {"/bin/sh", "-c", command}});
    EXPECT_TRUE(process);
    pollfd ended{.fd = process->fd(), .events = POLLIN, .revents = 0};
    EXPECT_EQ(::poll(&ended, 1, 200'000), 1) << "did not end";
    return {.exit_code = process->Reap().value_or(-1),
            .output = ReadFile(Path("output.txt")).value()};
  }

  TemporaryFolder folder_;
};

TEST_F(RelocMapTest, TrainsAMapThatLocalizeAndInfoRead) {
  const std::string train = "train --dataset . --iterations 3 --views 1 --threads 1 --out ";
  const Outcome trained = Run(train + "a.relocmap --report report");
  ASSERT_EQ(trained.exit_code, kExitOk) << trained.output;
  EXPECT_THAT(ReadFile(Path("report/report.txt")).value(), HasSubstr("held-out training frames: "));

  const Outcome localized =
      Run("localize --map a.relocmap --dataset . --frames 3:8 --out poses.csv");
  ASSERT_EQ(localized.exit_code, kExitOk) << localized.output;
  // Three steps teach it nothing.
  EXPECT_THAT(localized.output, HasSubstr("localized 0 of 5 frames: none found; "));
  const auto poses = CsvTable::Read(Path("poses.csv"));
  ASSERT_TRUE(poses) << poses.error().message;
  ASSERT_EQ(poses->row_count(), 5U);
  EXPECT_EQ(poses->Int64(0, 0).value(), 3);
  EXPECT_THAT(ReadFile(Path("poses.csv")).value(),
              HasSubstr(",region,cov_x_x,cov_x_y,cov_x_z,cov_x_rx,cov_x_ry,cov_x_rz,cov_y_y,"));

  const Outcome info = Run("info a.relocmap --json");
  EXPECT_EQ(info.exit_code, kExitOk);
  EXPECT_THAT(info.output,
              AllOf(HasSubstr(R"("format_version": 2)"), HasSubstr(R"("image_width": 240)")));

  ASSERT_EQ(Run(train + "b.relocmap").exit_code, kExitOk);
  EXPECT_EQ(ReadFile(Path("a.relocmap")).value(), ReadFile(Path("b.relocmap")).value());
}

TEST_F(RelocMapTest, TheNumberOfThreadsDoesNotChangeAMapOfSeveralRegions) {
  WriteDrive(20.0);
  const std::string train = "train --dataset . --iterations 2 --views 2 --region-length 10 ";
  const Outcome one = Run(train + "--threads 1 --out a.relocmap");
  ASSERT_EQ(one.exit_code, kExitOk) << one.output;
  const Outcome five = Run(train + "--threads 5 --out b.relocmap");
  ASSERT_EQ(five.exit_code, kExitOk) << five.output;
  EXPECT_EQ(ReadFile(Path("a.relocmap")).value(), ReadFile(Path("b.relocmap")).value());
  EXPECT_THAT(Run("info a.relocmap").output, HasSubstr("region2"));
}

TEST_F(RelocMapTest, CalibratedOnTheSameFramesAMapStaysAsItIs) {
  const Outcome trained = Run("train --dataset . --iterations 3 --views 1 --out a.relocmap");
  ASSERT_EQ(trained.exit_code, kExitOk) << trained.output;
  const Outcome again = Run("calibrate --map a.relocmap --dataset . --out b.relocmap");
  ASSERT_EQ(again.exit_code, kExitOk) << again.output;
  EXPECT_THAT(again.output, HasSubstr("of 1 frames"));
  EXPECT_EQ(ReadFile(Path("a.relocmap")).value(), ReadFile(Path("b.relocmap")).value());
}

TEST_F(RelocMapTest, GoesOnAfterAKillWithinARegionToTheSameBytes) {
  const std::string train =
      "train --dataset . --iterations 12 --views 1 --threads 1 --checkpoint-every 0 --out ";
  ASSERT_EQ(Run(train + "whole.relocmap").exit_code, kExitOk);
  EXPECT_FALSE(std::filesystem::exists(Path("whole.relocmap.partial")));

  RunUntil(train + "a.relocmap", "a.relocmap.partial", "region0.state");
  EXPECT_FALSE(std::filesystem::exists(Path("a.relocmap")));
  const Outcome resumed = Run(train + "a.relocmap");
  ASSERT_EQ(resumed.exit_code, kExitOk) << resumed.output;
  EXPECT_THAT(resumed.output,
              HasSubstr("a.relocmap.partial: goes on from an earlier run: 0 of 1 regions finished, "
                        "1 begun"));
  EXPECT_EQ(ReadFile(Path("a.relocmap")).value(), ReadFile(Path("whole.relocmap")).value());
  EXPECT_FALSE(std::filesystem::exists(Path("a.relocmap.partial")));
}

TEST_F(RelocMapTest, TakesFinishedRegionsUpButNotThoseOfOtherOptions) {
  WriteDrive(20.0);
  const std::string train =
      "train --dataset . --input-check off --iterations 2 --views 2 --region-length 10 --threads "
      "1 ";
  ASSERT_EQ(Run(train + "--out whole.relocmap").exit_code, kExitOk);
  RunUntil(train + "--out a.relocmap", "a.relocmap.partial", "region1.relocmap");
  std::filesystem::copy(Path("a.relocmap.partial"), Path("b.relocmap.partial"));
  const Outcome resumed = Run(train + "--out a.relocmap");
  ASSERT_EQ(resumed.exit_code, kExitOk) << resumed.output;
  EXPECT_THAT(resumed.output, HasSubstr("regions finished"));
  EXPECT_EQ(ReadFile(Path("a.relocmap")).value(), ReadFile(Path("whole.relocmap")).value());

  const Outcome other = Run(train + "--seed 2 --out b.relocmap");
  ASSERT_EQ(other.exit_code, kExitOk) << other.output;
  EXPECT_THAT(other.output, testing::Not(HasSubstr("goes on")));
  EXPECT_NE(ReadFile(Path("b.relocmap")).value(), ReadFile(Path("whole.relocmap")).value());
}

TEST_F(RelocMapTest, RefusesAMapForAnotherCamera) {
  const std::string train = "train --dataset . --iterations 2 --views 1 --out a.relocmap";
  ASSERT_EQ(Run(train).exit_code, kExitOk);
  folder_.Write("intrinsics.txt", "250 250 119.5 79.5 240 160\n");
  const Outcome outcome = Run("localize --map a.relocmap --dataset . --out poses.csv");
  EXPECT_EQ(outcome.exit_code, kExitConfig);
  EXPECT_THAT(outcome.output,
              AllOf(HasSubstr("a.relocmap is a map for another camera (240 x 160 px with f 220.0"),
                    HasSubstr("than that of . (240 x 160 px with f 250.0"),
                    HasSubstr("train a map with images of this camera")));
  folder_.Write("intrinsics.txt", "221 221 119.5 79.5 240 160\n");  // calibrated once more
  EXPECT_EQ(Run("localize --map a.relocmap --dataset . --out poses.csv").exit_code, kExitOk);
}

TEST_F(RelocMapTest, RefusesAMapThatIsMissingOrNone) {
  EXPECT_EQ(Run("info nothing.relocmap").exit_code, kExitConfig);
  folder_.Write("text.relocmap", "this is no map at all");
  const Outcome outcome = Run("localize --map text.relocmap --dataset . --out poses.csv");
  EXPECT_EQ(outcome.exit_code, kExitConfig);
  EXPECT_THAT(
      outcome.output,
      HasSubstr("reloc map: text.relocmap: begins with 'this is ', must begin with 'RELOCMAP'"));
}

TEST_F(RelocMapTest, RefusesImagesOfAnotherSize) {
  folder_.Write("intrinsics.txt", "220 220 119.5 79.5 320 160\n");
  const Outcome outcome = Run("train --dataset . --out a.relocmap");
  EXPECT_EQ(outcome.exit_code, kExitConfig);
  EXPECT_THAT(outcome.output,
              HasSubstr("all images are 240 x 160 pixels, must be 320 x 160 as intrinsics.txt"));
}

TEST_F(RelocMapTest, RefusesADriveThatIsTooShort) {
  const Outcome few = Run("train --dataset . --frames 0:5 --out a.relocmap");
  EXPECT_EQ(few.exit_code, kExitConfig);
  EXPECT_THAT(few.output, HasSubstr("5 training frames, must be at least 8"));
}

TEST_F(RelocMapTest, RefusesAWorldThatLiesOnItsSide) {
  std::string poses;
  for (int index = 0; index < 9; ++index) {  // a quarter turn about the optical axis: x is up
    poses += fmt::format("{:.1f} {} 0 0 0 0 0.70710678 0.70710678\n", 0.1 * index, 0.4 * index);
  }
  folder_.Write("poses_tum.txt", poses);
  const Outcome outcome = Run("train --dataset . --input-check off --out a.relocmap");
  EXPECT_EQ(outcome.exit_code, kExitConfig);
  EXPECT_THAT(outcome.output,
              HasSubstr("up axis is +x of the data set's world, must be +z, +y or -y"));
}

TEST_F(RelocMapTest, ChecksADriveAndSaysWhatIsWrong) {
  const Outcome usable = Run("check --dataset .");
  EXPECT_EQ(usable.exit_code, kExitOk) << usable.output;
  EXPECT_THAT(usable.output,
              AllOf(HasSubstr(".: 9 frames, 3.2 m in 0.8 s, an image every 0.40 m\n"),
                    HasSubstr(".: warning: frames: 9 frames are few"),
                    HasSubstr("\n.: usable\n")));

  std::string poses;  // the world seen from the camera
  for (int index = 0; index < 9; ++index)
    poses += fmt::format("{:.1f} {} {} 0 0 0 0 1\n", 0.1 * index, -0.4 * index, -0.02 * index);
  folder_.Write("poses_tum.txt", poses);
  const Outcome inverted = Run("check --dataset .");
  EXPECT_EQ(inverted.exit_code, kExitConfig);
  EXPECT_THAT(inverted.output,
              AllOf(HasSubstr(".: refused: poses: "),
                    HasSubstr("if the poses are world to camera: write poses_tum.txt as")));
}

TEST_F(RelocMapTest, ARefusalCanBeOverridden) {
  std::string poses;
  for (int index = 0; index < 9; ++index)
    poses += fmt::format("{:.1f} {} {} 0 0 0 0 1\n", 0.1 * index, -0.4 * index, -0.02 * index);
  folder_.Write("poses_tum.txt", poses);
  const std::string train =
      "train --dataset . --iterations 3 --views 1 --threads 1 --out a.relocmap";
  const Outcome refused = Run(train);
  EXPECT_EQ(refused.exit_code, kExitConfig);
  EXPECT_THAT(refused.output,
              AllOf(HasSubstr("reloc map: .: poses: "),
                    HasSubstr("(--input-check warn makes the map nevertheless)")));
  const Outcome warned = Run(train + " --input-check warn");
  EXPECT_EQ(warned.exit_code, kExitOk) << warned.output;
  EXPECT_THAT(warned.output, HasSubstr(".: warning: poses: "));
  const Outcome misspelt = Run(train + " --input-check never");
  EXPECT_EQ(misspelt.exit_code, kExitConfig);
  EXPECT_THAT(misspelt.output, HasSubstr("is 'never', must be refuse, warn or off"));
}

TEST_F(RelocMapTest, RefusesAWrongCommandLine) {
  EXPECT_EQ(Run("train --dataset .").exit_code, kExitUsage);
  EXPECT_EQ(Run("").exit_code, kExitUsage);
  EXPECT_EQ(Run("--help").exit_code, kExitOk);
}

}  // namespace
}  // namespace relocd
