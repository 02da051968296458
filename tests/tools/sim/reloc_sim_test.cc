#include <chrono>
#include <filesystem>
#include <string>
#include <thread>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>

#include "camera/dataset.h"
#include "camera/jpeg.h"
#include "camera/measured_depth.h"
#include "can/candump_log.h"
#include "can/socket_can_source.h"
#include "config/config.h"
#include "core/csv.h"
#include "core/file.h"
#include "depth_file.h"
#include "odometry/wheel_odometry.h"
#include "recording/log_reader.h"
#include "support/run_program.h"
#include "support/temporary_folder.h"

namespace relocd {
namespace {

using testing::HasSubstr;

const std::string kVehicles = std::string(RELOCD_SOURCE_DIR) + "/config/vehicles/";

/// Runs reloc-sim as a person would.
Ended RunTool(const std::string& arguments, const std::string& before = "") {
  return RunProgram(before + RELOC_SIM " " + arguments);
}

class RelocSimTest : public testing::Test {
 protected:
  /// A short drive with small images.
  [[nodiscard]] std::string DriveArguments(const std::string& more = "") const {
    return "--vehicle " + kVehicles + "ackermann_demo.yaml --out " + out_ +
           " --size 64x48 --samples 1 --frame-rate-hz 2 --from-m 20 --to-m 28 --speed-mps 6 " +
           more;
  }
  static bool Exists(const std::string& path) { return std::filesystem::exists(path); }

  TemporaryFolder folder_;
  std::string out_ = folder_.path() + "/drive";
};

TEST_F(RelocSimTest, RendersADriveIntoADataSet) {
  const Ended ended = RunTool(DriveArguments("--session evening+wet"));
  ASSERT_EQ(ended.exit_code, 0) << ended.output;
  EXPECT_THAT(ended.output,
              testing::ContainsRegex("drive: 8.[0-9] m in [0-9.]+ s; [0-9]+ CAN "
                                     "frames; [0-9]+ images, [0-9.]+/s"));
  const auto dataset = ReadDataset(out_);
  ASSERT_TRUE(dataset) << dataset.error().message;
  ASSERT_GT(dataset->frames.size(), 8U);
  for (const DatasetFrame& frame : dataset->frames) {
    const auto bytes = ReadFile(frame.image_path);
    ASSERT_TRUE(bytes);
    EXPECT_EQ(ReadJpegSize(AsBytes(*bytes)).value(), (JpegSize{.width = 64, .height = 48}));
    EXPECT_NEAR(frame.X_WC.R()(2, 2), 0.0, 0.1);  // looks ahead
  }
  EXPECT_NEAR(dataset->intrinsics.fx, 32.0, 1e-9);  // 90 degrees over 64 px
  const std::string session = ReadFile(out_ + "/session.txt").value();
  EXPECT_THAT(session, HasSubstr("session: evening+wet\n"));
  EXPECT_THAT(session, HasSubstr("command: reloc sim --vehicle "));
  EXPECT_FALSE(Exists(out_ + ".partial"));
}

TEST_F(RelocSimTest, WritesDepthImagesOfWhatTheImagesShow) {
  constexpr double kCameraHeightM = 1.65;  // as the vehicle's file has it
  const Ended ended = RunTool(DriveArguments("--depth"));
  ASSERT_EQ(ended.exit_code, 0) << ended.output;
  const auto dataset = ReadDataset(out_);
  ASSERT_TRUE(dataset) << dataset.error().message;
  for (const DatasetFrame& frame : dataset->frames) {
    ASSERT_EQ(frame.depth_path, fmt::format("{}/depth/{:06}.png", out_, frame.index));
    const auto depth = ReadDepthFile(frame.depth_path, 64, 48);
    ASSERT_TRUE(depth) << depth.error().message;
    // The road below the camera, in the picture's two lowest rows.
    const float inverse_depth = MeasuredInverseDepth(*depth, {32.0F, 47.0F});
    ASSERT_GT(inverse_depth, 0.0F);
    const double down = (46.5 - dataset->intrinsics.cy) / dataset->intrinsics.fy;
    EXPECT_NEAR(down / static_cast<double>(inverse_depth), kCameraHeightM, 0.1);
  }
}

TEST_F(RelocSimTest, TheCopiedVehicleDecodesTheFrames) {
  ASSERT_EQ(RunTool(DriveArguments("--no-images --no-wheel-errors")).exit_code, 0);
  const auto config = LoadConfig(out_ + "/vehicle.yaml", {});
  ASSERT_TRUE(config) << config.error().message;
  const auto dbc = DbcFile::Read(config->can.dbc_file);
  ASSERT_TRUE(dbc);
  auto odometry = WheelOdometry::Create(config->odometry, *dbc);
  auto log = CandumpLog::Open(out_ + "/can0.log");
  const auto truth = CsvTable::Read(out_ + "/truth_body.csv");
  ASSERT_TRUE(odometry && log && truth);
  std::size_t row = 0;
  double x_m = 0.0;
  while (true) {
    const auto record = log->Next();
    ASSERT_TRUE(record);
    if (!record->has_value()) break;
    if (const auto increment = odometry->Handle((*record)->frame)) {
      EXPECT_EQ(*truth->Int64(row++, 0), ToNanoseconds(increment->time));
      x_m = increment->X_OB.x();
    }
  }
  EXPECT_EQ(row, truth->row_count());
  EXPECT_NEAR(x_m, 8.0, 0.5);
}

TEST_F(RelocSimTest, TheSameCommandMakesTheSame) {
  ASSERT_EQ(RunTool(DriveArguments("--threads 1")).exit_code, 0);
  std::vector<std::string> first;
  for (const char* const name : {"/can0.log", "/poses_tum.txt", "/images/000009.jpg"})
    first.push_back(ReadFile(out_ + name).value());
  std::filesystem::rename(out_, out_ + ".first");
  ASSERT_EQ(RunTool(DriveArguments("--threads 2")).exit_code, 0);
  EXPECT_EQ(ReadFile(out_ + "/can0.log").value(), first[0]);
  EXPECT_EQ(ReadFile(out_ + "/poses_tum.txt").value(), first[1]);
  EXPECT_EQ(ReadFile(out_ + "/images/000009.jpg").value(), first[2]);
}

TEST_F(RelocSimTest, SessionsHaveNoiseOfTheirOwn) {
  ASSERT_EQ(RunTool(DriveArguments("--no-images --session noon")).exit_code, 0);
  const std::string noon = ReadFile(out_ + "/can0.log").value();
  std::filesystem::remove_all(out_);
  ASSERT_EQ(RunTool(DriveArguments("--no-images --session evening")).exit_code, 0);
  EXPECT_NE(ReadFile(out_ + "/can0.log").value(), noon);
}

TEST_F(RelocSimTest, ListsSessionsAndWorlds) {
  const Ended sessions = RunTool("--list-sessions");
  EXPECT_EQ(sessions.exit_code, 0);
  EXPECT_THAT(sessions.output, HasSubstr("  reparked   other cars are parked"));
  const Ended worlds = RunTool("--list-worlds");
  EXPECT_EQ(worlds.exit_code, 0);
  EXPECT_THAT(worlds.output, testing::StartsWith("campus\n"));
}

struct Refusal {
  std::string arguments;
  int exit_code;
  std::string says;
};

TEST_F(RelocSimTest, SaysWhatIsWrong) {
  const std::vector<Refusal> refusals{
      {"--session nun", 78, "unknown word 'nun', did you mean 'noon'?"},
      {"--world nowhere", 78, "world 'nowhere' is unknown"},
      {"--camera rear", 78, "has no camera 'rear', --camera must be one of front"},
      {"--size 640", 78, "--size is '640', must be WIDTHxHEIGHT"},
      {"--fov-deg 200", 78, "--fov-deg is 200, must be in [5, 150]"},
      {"--frame-rate-hz 0", 78, "--frame-rate-hz is 0, must be in [0.1, 120]"},
      {"--rough -1", 78, "roughness is -1, must be in [0, 20]"},
      {"--to-m 9999", 78, "must be on the route, in [0, 6"},
      {"--slip 7", 78, "traction_slip is 7, must be in [0, 0.1]"},
      {"--laps many", 2, "--laps"},
      {"--no-such-option", 2, "--no-such-option"},
      {"--no-images --live-video /dev/video0", 78, "--live-video needs images"},
      {"--live-video /dev/null", 1, "--live-video: /dev/null: is no V4L2 device"},
      {"--live-video /nowhere", 1, "--live-video: /nowhere: opening: No such file or directory"},
      {"--live-can nocan7", 1, "nocan7"}};
  for (const Refusal& refusal : refusals) {
    const Ended ended = RunTool("--vehicle " + kVehicles + "ackermann_demo.yaml --out " + out_ +
                                " " + refusal.arguments);
    EXPECT_EQ(ended.exit_code, refusal.exit_code) << refusal.arguments << "\n" << ended.output;
    EXPECT_THAT(ended.output, HasSubstr(refusal.says)) << refusal.arguments;
    EXPECT_FALSE(Exists(out_) || Exists(out_ + ".partial")) << refusal.arguments;
  }
  EXPECT_EQ(RunTool("").exit_code, 2);
  EXPECT_EQ(RunTool("--out " + out_).exit_code, 2);
  EXPECT_EQ(RunTool("--out " + out_ + " --vehicle /nowhere.yaml").exit_code, 1);
}

TEST_F(RelocSimTest, WheelsSayWhatIsWrong) {
  const std::vector<Refusal> refusals{
      {"--camera-forward-m nan", 78, "--camera-forward-m is nan, must be in [-100, 100]"},
      {"--begin-s nan", 78, "--begin-s is nan and --end-s inf, must be a time and a later one"},
      {"--begin-s 2 --end-s 1", 78, "--begin-s is 2 and --end-s 1, must be a time and a later"}};
  for (const Refusal& refusal : refusals) {
    const Ended ended = RunTool("wheels --config " + kVehicles + "ackermann_demo.yaml --out " +
                                out_ + " --trajectory x.csv " + refusal.arguments);
    EXPECT_EQ(ended.exit_code, refusal.exit_code) << refusal.arguments;
    EXPECT_THAT(ended.output, HasSubstr(refusal.says));
  }
}

TEST_F(RelocSimTest, WritesOverNothing) {
  std::filesystem::create_directories(out_);
  const Ended ended = RunTool(DriveArguments());
  EXPECT_EQ(ended.exit_code, 78);
  EXPECT_THAT(ended.output, HasSubstr("exists, must be a new folder"));
}

/// A limit on the size of files, in units of 512 or 1024 bytes, stands in for a full disk.
TEST_F(RelocSimTest, AFullDiskLeavesAPartThatIsNamedSo) {
  const Ended ended = RunTool(DriveArguments("--no-images"), "trap '' XFSZ; ulimit -f 8; exec ");
  EXPECT_EQ(ended.exit_code, 1) << ended.output;
  EXPECT_THAT(ended.output,
              HasSubstr("File too large; the drive is not complete, " + out_ +
                        ".partial has a part of it"));
  EXPECT_FALSE(Exists(out_));
  EXPECT_TRUE(Exists(out_ + ".partial"));
}

/// Receives frames from a socket that will be there, until it is closed.
int ReceiveAll(const std::string& path) {
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  while (std::chrono::steady_clock::now() < deadline) {
    auto socket = ConnectCanSocket(path, {});
    if (!socket) {
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
      continue;
    }
    for (int count = 0;;) {
      const auto frame = socket->Receive();
      if (!frame) return count;
      if (frame->has_value()) {
        ++count;
      } else {
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
      }
    }
  }
  return -1;
}

TEST_F(RelocSimTest, PlaysADriveLive) {
  std::string frames;
  for (int i = 0; i < 30; ++i)
    frames += "(0." + std::to_string(100'000 + 10'000 * i) + ") can0 101#0102\n";
  const std::string log = folder_.Write("can0.log", frames);
  const std::string socket = folder_.path() + "/bus";
  int received = 0;
  std::jthread client([&] { received = ReceiveAll(socket); });
  const Ended ended = RunTool("play --dataset " + folder_.path() + " --live-can unix:" + socket);
  client.join();
  EXPECT_EQ(ended.exit_code, 0) << ended.output;
  EXPECT_EQ(received, 30);
  EXPECT_THAT(ended.output, HasSubstr("live: 30 CAN frames, "));
  EXPECT_FALSE(Exists(socket));
}

TEST_F(RelocSimTest, PlayingSaysWhatIsWrong) {
  const std::string dataset = "play --dataset " + folder_.path();
  EXPECT_THAT(RunTool(dataset).output, HasSubstr("nothing to play to, must have --live-can"));
  const Ended no_log = RunTool(dataset + " --live-can unix:" + folder_.path() + "/bus");
  EXPECT_EQ(no_log.exit_code, 1);
  EXPECT_THAT(no_log.output, HasSubstr("/can0.log"));
  const Ended no_images = RunTool(dataset + " --live-video /dev/null");
  EXPECT_THAT(no_images.output, HasSubstr("/frames.txt"));
}

}  // namespace
}  // namespace relocd
