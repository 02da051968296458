#include "simulation/drive_writer.h"

#include <signal.h>
#include <sys/resource.h>

#include <cstdint>
#include <filesystem>
#include <map>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "camera/dataset.h"
#include "camera/jpeg.h"
#include "core/csv.h"
#include "core/file.h"
#include "geometry/planar.h"
#include "messaging/bounded_decode.h"
#include "messaging/can_frame_message.h"
#include "messaging/channels.h"
#include "messaging/image_metadata.h"
#include "recording/log_reader.h"
#include "support/temporary_folder.h"
#include "support/test_images.h"

namespace relocd {
namespace {

using testing::HasSubstr;

constexpr int kImages = 7;
constexpr int kFrames = 100;  // a second
const Pose3 kX_BC(RotationFromRollPitchYaw(-std::numbers::pi / 2.0, 0.0, -std::numbers::pi / 2.0),
                  Eigen::Vector3d(1.0, 0.0, 1.6));

/// A second along x at 1 m/s, to the north-west.
DriveRecord Record() {
  DriveRecord record;
  record.intrinsics = {.fx = 50.0, .fy = 50.0, .cx = 31.5, .cy = 23.5, .width = 64, .height = 48};
  for (int i = 0; i < kFrames; ++i) {
    WheelMotion motion{.time_ns = i * std::int64_t{10'000'000}};
    motion.X_WB = Pose2(0.01 * i, 2.0, 0.75 * std::numbers::pi);
    motion.travel_m.fill(0.01 * i);
    record.motions.push_back(motion);
    CandumpRecord frame{.time_ns = motion.time_ns, .interface = "can0"};
    frame.frame.id.value = 0x101;
    frame.frame.size = 8;
    frame.frame.data[0] = static_cast<std::uint8_t>(i);
    frame.frame.receive_time = FromNanoseconds(motion.time_ns);
    record.can_frames.push_back(frame);
    frame.frame.id.value = 0x102;
    record.can_frames.push_back(frame);
  }
  for (int i = 0; i < kImages; ++i) {
    const Pose3 X_WB = LiftFromPlane(Pose2(0.125 * i, 2.0, 0.75 * std::numbers::pi));
    record.X_WCs.push_back({.time_ns = i * std::int64_t{125'000'000}, .X_WB = X_WB * kX_BC});
  }
  record.texts["session.txt"] = "world: none\n";
  return record;
}

class DriveWriterTest : public testing::Test {
 protected:
  /// Writes the whole drive.
  void WriteDrive() {
    auto writer = DriveWriter::Create(folder_, Record());
    ASSERT_TRUE(writer) << writer.error().message;
    for (int i = 0; i < kImages; ++i)
      ASSERT_TRUE(writer->AddImage(MakeTestJpeg(64, 48)));
    ASSERT_TRUE(writer->Finish());
  }
  static bool Exists(const std::string& path) { return std::filesystem::exists(path); }

  TemporaryFolder temporary_;
  std::string folder_ = temporary_.path() + "/drive";
};

TEST_F(DriveWriterTest, IsADataSet) {
  WriteDrive();
  const auto dataset = ReadDataset(folder_);
  ASSERT_TRUE(dataset) << dataset.error().message;
  EXPECT_EQ(dataset->intrinsics, Record().intrinsics);
  ASSERT_EQ(dataset->frames.size(), static_cast<std::size_t>(kImages));
  for (std::size_t i = 0; i < dataset->frames.size(); ++i) {
    const DatasetFrame& frame = dataset->frames[i];
    EXPECT_EQ(frame.time_ns, Record().X_WCs[i].time_ns);
    EXPECT_LT((frame.X_WC.Inverse() * Record().X_WCs[i].X_WB).Log().norm(), 1e-8);
    EXPECT_TRUE(ReadGrayImage(frame.image_path));
  }
  const auto split = ReadSplit(folder_ + "/split_every5.txt");
  ASSERT_TRUE(split);
  EXPECT_EQ(split->at(2), SplitPart::kTest);
  EXPECT_EQ(split->at(3), SplitPart::kTrain);
  EXPECT_EQ(ReadFile(folder_ + "/session.txt").value(), "world: none\n");
  EXPECT_FALSE(Exists(folder_ + ".partial"));
}

TEST_F(DriveWriterTest, HasTheTruthOfCameraBodyAndWheels) {
  WriteDrive();
  const auto camera = CsvTable::Read(folder_ + "/planar_truth.csv");
  ASSERT_TRUE(camera);
  const auto columns = camera->Columns({"t_s", "x_m", "y_m", "theta_rad"});
  ASSERT_TRUE(columns);
  EXPECT_NEAR(*camera->Double(2, (*columns)[0]), 0.25, 1e-9);
  EXPECT_NEAR(*camera->Double(2, (*columns)[1]), 0.25 - std::numbers::sqrt2 / 2.0, 1e-8);
  EXPECT_NEAR(*camera->Double(2, (*columns)[3]), 0.75 * std::numbers::pi, 1e-8);
  const auto body = CsvTable::Read(folder_ + "/truth_body.csv");
  ASSERT_TRUE(body);
  EXPECT_TRUE(body->Columns({"time_ns", "x_m", "y_m", "heading_rad"}));
  EXPECT_EQ(body->row_count(), static_cast<std::size_t>(kFrames));
  const auto wheels = CsvTable::Read(folder_ + "/truth_wheels.csv");
  ASSERT_TRUE(wheels);
  const auto rear_left = wheels->Columns({"rear_left_m"});
  ASSERT_TRUE(rear_left);
  EXPECT_NEAR(*wheels->Double(42, rear_left->front()), 0.42, 1e-9);
}

TEST_F(DriveWriterTest, CandumpReadsBack) {
  WriteDrive();
  auto log = CandumpLog::Open(folder_ + "/can0.log");
  ASSERT_TRUE(log);
  for (const CandumpRecord& expected : Record().can_frames) {
    const auto record = log->Next();
    ASSERT_TRUE(record && record->has_value());
    EXPECT_EQ((*record)->time_ns, expected.time_ns);
    EXPECT_EQ((*record)->frame.data, expected.frame.data);
  }
  EXPECT_FALSE(log->Next()->has_value());
}

TEST_F(DriveWriterTest, LogHasWhatTheDaemonsPublish) {
  WriteDrive();
  auto log = LogReader::Open(folder_ + "/drive.lcmlog");
  ASSERT_TRUE(log);
  std::map<std::string, int> counts;
  std::int64_t last_us = 0;
  std::size_t can_frames = 0;
  while (const auto event = log->Next()) {
    EXPECT_GE(event->timestamp_us, last_us);
    last_us = event->timestamp_us;
    const int sequence = counts[event->channel]++;
    if (event->channel == "IMAGE_front") {
      const auto image = DecodeBounded<image_t>(event->data);
      ASSERT_TRUE(image);
      const auto metadata = FindImageMetadata(*image);
      ASSERT_TRUE(metadata);
      EXPECT_EQ(metadata->mono_ns, sequence * std::int64_t{125'000'000});
      EXPECT_EQ(metadata->seq, sequence);
      EXPECT_EQ(image->width, 64);
      EXPECT_TRUE(DecodeJpegToGray(image->data));
    } else {
      const auto frames = DecodeBounded<can_frames_t>(event->data);
      ASSERT_TRUE(frames);
      EXPECT_EQ(frames->seq, sequence);
      EXPECT_EQ(frames->mono_ns, sequence * std::int64_t{10'000'000});
      for (const can_frame_t& frame : frames->frames)
        EXPECT_EQ(FromMessage(frame).data, Record().can_frames.at(can_frames++).frame.data);
    }
  }
  EXPECT_EQ(counts, (std::map<std::string, int>{{"IMAGE_front", kImages}, {"CAN_can0", kFrames}}));
  EXPECT_EQ(can_frames, Record().can_frames.size());
  EXPECT_EQ(log->counters().damaged_places, 0);
}

TEST_F(DriveWriterTest, ADriveWithoutImagesIsNoDataSetOfThem) {
  DriveRecord record = Record();
  record.X_WCs.clear();
  auto writer = DriveWriter::Create(folder_, std::move(record));
  ASSERT_TRUE(writer);
  ASSERT_TRUE(writer->Finish());
  EXPECT_TRUE(Exists(folder_ + "/truth_body.csv"));
  EXPECT_FALSE(Exists(folder_ + "/frames.txt"));
  EXPECT_FALSE(Exists(folder_ + "/images"));
}

TEST_F(DriveWriterTest, AnInterruptedDriveKeepsThePartialName) {
  {
    auto writer = DriveWriter::Create(folder_, Record());
    ASSERT_TRUE(writer);
    ASSERT_TRUE(writer->AddImage(MakeTestJpeg(64, 48)));
  }
  EXPECT_FALSE(Exists(folder_));
  EXPECT_TRUE(Exists(folder_ + ".partial/images/000000.jpg"));
  WriteDrive();  // which takes its place
  EXPECT_FALSE(Exists(folder_ + ".partial"));
}

/// A limit on the size of files stands in for a full disk.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(rlim_t bytes) : signal_(::signal(SIGXFSZ, SIG_IGN)) {
    ::getrlimit(RLIMIT_FSIZE, &before_);
    const rlimit limit{.rlim_cur = bytes, .rlim_max = before_.rlim_max};
    ::setrlimit(RLIMIT_FSIZE, &limit);
  }
  FileSizeLimit(const FileSizeLimit&) = delete;
  FileSizeLimit& operator=(const FileSizeLimit&) = delete;
  ~FileSizeLimit() {
    ::setrlimit(RLIMIT_FSIZE, &before_);
    ::signal(SIGXFSZ, signal_);
  }

 private:
  sighandler_t signal_;
  rlimit before_{};
};

TEST_F(DriveWriterTest, AFullDiskIsAnErrorThatNamesWhatIsLeft) {
  std::string message;
  {
    const FileSizeLimit limit(100);  // of any of the tables
    const auto writer = DriveWriter::Create(folder_, Record());
    ASSERT_FALSE(writer);
    EXPECT_EQ(writer.error().kind, ErrorKind::kUnavailable);
    message = writer.error().message;
  }
  EXPECT_THAT(message, HasSubstr("writing " + folder_ + ".partial/can0.log: "));
  EXPECT_THAT(message,
              HasSubstr("; the drive is not complete, " + folder_ + ".partial has a part of it"));
  EXPECT_FALSE(Exists(folder_));
}

TEST_F(DriveWriterTest, AnImageThatDoesNotFitIsAnErrorToo) {
  auto writer = DriveWriter::Create(folder_, Record());
  ASSERT_TRUE(writer);
  Result<void> ok;
  {
    const FileSizeLimit limit(100);
    ok = writer->AddImage(MakeTestJpeg(64, 48));
  }
  ASSERT_FALSE(ok);
  EXPECT_THAT(ok.error().message, HasSubstr(".partial/images/000000.jpg: "));
  EXPECT_FALSE(Exists(folder_));
}

TEST_F(DriveWriterTest, TouchesNothingThatIsThere) {
  std::filesystem::create_directories(folder_);
  EXPECT_EQ(DriveWriter::Create(folder_ + "/", Record()).error().message,
            "'" + folder_ + "' exists, must be a new folder");
  const std::string other = temporary_.path() + "/other";
  const std::string precious = temporary_.Write("other.partial/thesis.txt", "all of it");
  EXPECT_THAT(DriveWriter::Create(other, Record()).error().message,
              HasSubstr("exists, and is no part of a drive"));
  EXPECT_TRUE(Exists(precious));
}

}  // namespace
}  // namespace relocd
