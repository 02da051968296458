#include "simulation/drive_writer.h"

#include <cmath>
#include <filesystem>
#include <iterator>
#include <limits>
#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "camera/frame_source.h"
#include "can/can_bus_status.h"
#include "core/file.h"
#include "messaging/can_frame_message.h"
#include "messaging/channels.h"
#include "messaging/image_message.h"

namespace relocd {
namespace {

/// odometryd passes frames on in batches of this length.
constexpr std::int64_t kBatchNs = 10'000'000;
/// A simulated drive has no date: its log begins on this one, 2024-01-01.
constexpr std::int64_t kLogBeginUs = 1'704'067'200'000'000;
constexpr std::int64_t kRunId = 1;
/// Each fifth image, as in other data sets, is for testing a map.
constexpr std::size_t kSplitEvery = 5;
constexpr std::size_t kSplitPlace = 2;

std::int64_t LogTime_us(std::int64_t time_ns) {
  return kLogBeginUs + time_ns / 1000;
}

Error FileSystemError(const std::string& doing, const std::error_code& error) {
  return {ErrorKind::kUnavailable, fmt::format("{}: {}", doing, error.message())};
}

/// Where the camera is in the plane, and where it looks.
Pose2 CameraInPlane(const Pose3& X_WC) {
  const Eigen::Vector3d ahead_W = X_WC.R().col(2);
  return {X_WC.translation().x(), X_WC.translation().y(), std::atan2(ahead_W.y(), ahead_W.x())};
}

std::string FormatIntrinsics(const CameraIntrinsics& camera) {
  std::string text = fmt::format(
      "{} {} {} {} {} {}", camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height);
  if (camera.distortion != CameraIntrinsics().distortion) {
    for (const double coefficient : camera.distortion)
      text += fmt::format(" {}", coefficient);
  }
  return text + '\n';
}

std::string FormatImageList(std::size_t count) {
  std::string text;
  for (std::size_t i = 0; i < count; ++i)
    text += DriveImageName(i) + '\n';
  return text;
}

std::string FormatSplit(std::size_t count) {
  std::string text;
  for (std::size_t i = 0; i < count; ++i) {
    const char* const part = i % kSplitEvery == kSplitPlace ? "test" : "train";
    text += fmt::format("{} {} {}\n", i, DriveImageName(i), part);
  }
  return text;
}

std::string FormatPlanarTruth(const Trajectory3& X_WCs) {
  std::string text = "t_s,x_m,y_m,theta_rad\n";
  for (const TimedPose3& pose : X_WCs) {
    const Pose2 X_WC = CameraInPlane(pose.X_WB);
    text += fmt::format("{:.9f},{:.9f},{:.9f},{:.9f}\n",
                        static_cast<double>(pose.time_ns) * 1e-9,
                        X_WC.x(),
                        X_WC.y(),
                        X_WC.yaw());
  }
  return text;
}

std::string FormatBodyTruth(const std::vector<WheelMotion>& motions) {
  std::string text = "time_ns,x_m,y_m,heading_rad\n";
  for (const WheelMotion& motion : motions) {
    text += fmt::format("{},{:.9f},{:.9f},{:.9f}\n",
                        motion.time_ns,
                        motion.X_WB.x(),
                        motion.X_WB.y(),
                        motion.X_WB.yaw());
  }
  return text;
}

std::string FormatWheelTruth(const std::vector<WheelMotion>& motions) {
  std::string text =
      "time_ns,rear_left_m,rear_right_m,front_left_m,front_right_m,"
      "rear_left_mps,rear_right_mps,front_left_mps,front_right_mps,steering_rad,yaw_rate_radps\n";
  for (const WheelMotion& motion : motions) {
    text += fmt::format("{}", motion.time_ns);
    for (const double travel_m : motion.travel_m)
      text += fmt::format(",{:.9f}", travel_m);
    for (const double speed_mps : motion.speeds_mps)
      text += fmt::format(",{:.7f}", speed_mps);
    text += fmt::format(",{:.7f},{:.7f}\n", motion.steering_rad, motion.yaw_rate_radps);
  }
  return text;
}

std::string FormatCandump(const std::vector<CandumpRecord>& records) {
  std::string text;
  for (const CandumpRecord& record : records)
    text += FormatCandumpLine(record) + '\n';
  return text;
}

constexpr const char* kLogName = "drive.lcmlog";

std::string PartialOf(const std::string& folder) {
  return folder + ".partial";
}

std::string WithoutSlash(std::string folder) {
  while (folder.size() > 1 && folder.back() == '/')
    folder.pop_back();
  return folder;
}

template <typename Message>
Result<void> Append(const Channel<Message>& channel,
                    const Message& message,
                    std::int64_t time_us,
                    LogWriter& log) {
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(message.getEncodedSize()));
  message.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  return log.Append(time_us, channel.name, bytes);
}

}  // namespace

std::string DriveImageName(std::size_t index) {
  return fmt::format("images/{:06}.jpg", index);
}

std::string DriveDepthName(std::size_t index) {
  return fmt::format("depth/{:06}.png", index);
}

Result<void> DriveWriter::Check(const std::string& folder) {
  const std::string name = WithoutSlash(folder);
  const std::string partial = PartialOf(name);
  std::error_code ignored;
  if (name.empty() || std::filesystem::exists(name, ignored)) {
    return Error{ErrorKind::kInvalidInput, fmt::format("'{}' exists, must be a new folder", name)};
  }
  if (std::filesystem::exists(partial, ignored) &&
      !std::filesystem::exists(fmt::format("{}/{}", partial, kLogName), ignored)) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("'{}' exists, and is no part of a drive: move it away", partial)};
  }
  return {};
}

Result<DriveWriter> DriveWriter::Create(const std::string& folder, DriveRecord record) {
  if (auto ok = Check(folder); !ok) return std::move(ok).error();
  std::string name = WithoutSlash(folder);
  const std::string partial = PartialOf(name);
  std::error_code error;
  std::filesystem::remove_all(partial, error);
  if (error) return FileSystemError(fmt::format("deleting {}", partial), error);
  const std::string images = partial + (record.X_WCs.empty() ? "" : "/images");
  std::filesystem::create_directories(images, error);
  if (error) return FileSystemError(fmt::format("creating {}", images), error);
  auto log = LogWriter::Create(fmt::format("{}/{}", partial, kLogName));
  if (!log) return std::move(log).error();
  DriveWriter writer(std::move(name), std::move(record), std::move(log).value());
  if (auto ok = writer.Explain(writer.WriteTexts()); !ok) return std::move(ok).error();
  return writer;
}

DriveWriter::DriveWriter(std::string folder, DriveRecord record, LogWriter log)
    : folder_(std::move(folder)),
      partial_(PartialOf(folder_)),
      record_(std::move(record)),
      log_(std::move(log)) {}

Result<void> DriveWriter::WriteTexts() const {
  std::map<std::string, std::string> texts = record_.texts;
  texts["intrinsics.txt"] = FormatIntrinsics(record_.intrinsics);
  texts["truth_body.csv"] = FormatBodyTruth(record_.motions);
  texts["truth_wheels.csv"] = FormatWheelTruth(record_.motions);
  texts[record_.can_interface + ".log"] = FormatCandump(record_.can_frames);
  if (!record_.X_WCs.empty()) {
    texts["frames.txt"] = FormatImageList(record_.X_WCs.size());
    texts["split_every5.txt"] = FormatSplit(record_.X_WCs.size());
    texts["poses_tum.txt"] = FormatTumTrajectory(record_.X_WCs);
    texts["planar_truth.csv"] = FormatPlanarTruth(record_.X_WCs);
  }
  for (const auto& [name, text] : texts) {
    if (auto ok = WriteFile(fmt::format("{}/{}", partial_, name), text); !ok) return ok;
  }
  return {};
}

Result<void> DriveWriter::AddImage(std::span<const std::uint8_t> jpeg) {
  RELOCD_CHECK(images_ < record_.X_WCs.size(), "no more images than poses");
  const std::string path = fmt::format("{}/{}", partial_, DriveImageName(images_));
  const auto* const bytes = reinterpret_cast<const char*>(jpeg.data());
  if (auto ok = Explain(WriteFile(path, {bytes, jpeg.size()})); !ok) return ok;
  if (auto ok = Explain(LogCanBefore(record_.X_WCs[images_].time_ns)); !ok) return ok;
  return Explain(LogImage(jpeg));
}

Result<std::string> DriveWriter::MakeDepthPath() const {
  RELOCD_CHECK(images_ > 0, "a depth image comes after its image");
  const std::string folder = partial_ + "/depth";
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) return Incomplete(FileSystemError(fmt::format("creating {}", folder), error));
  return fmt::format("{}/{}", partial_, DriveDepthName(images_ - 1));
}

Result<void> DriveWriter::LogImage(std::span<const std::uint8_t> jpeg) {
  const std::int64_t time_ns = record_.X_WCs[images_].time_ns;
  const auto sequence = static_cast<std::int64_t>(images_++);
  const image_t message =
      ToMessage(Frame{.bytes = {jpeg.begin(), jpeg.end()},
                      .width = record_.intrinsics.width,
                      .height = record_.intrinsics.height,
                      .time = FromNanoseconds(time_ns),
                      .sequence = sequence},
                {.utime = LogTime_us(time_ns), .seq = sequence, .run_id = kRunId});
  return Append(ImageChannel(record_.camera), message, LogTime_us(time_ns), log_);
}

Result<void> DriveWriter::LogCanBefore(std::int64_t time_ns) {
  const std::vector<CandumpRecord>& frames = record_.can_frames;
  while (can_frames_ < frames.size() && frames[can_frames_].time_ns <= time_ns) {
    const std::int64_t batch = frames[can_frames_].time_ns / kBatchNs;
    can_frames_t message{};
    for (; can_frames_ < frames.size() && frames[can_frames_].time_ns / kBatchNs == batch;
         ++can_frames_) {
      message.frames.push_back(ToMessage(frames[can_frames_].frame));
    }
    const std::int64_t last_ns = frames[can_frames_ - 1].time_ns;
    message.utime = LogTime_us(last_ns);
    message.mono_ns = last_ns;
    message.seq = can_batches_++;
    message.run_id = kRunId;
    message.bus_state = static_cast<std::int32_t>(CanBusState::kActive);
    message.n = static_cast<std::int32_t>(message.frames.size());
    const auto channel = CanChannel(record_.can_interface);
    if (auto ok = Append(channel, message, message.utime, log_); !ok) return ok;
  }
  return {};
}

Result<void> DriveWriter::Finish() {
  RELOCD_CHECK(images_ == record_.X_WCs.size(), "as many images as poses");
  if (auto ok = Explain(LogCanBefore(std::numeric_limits<std::int64_t>::max())); !ok) return ok;
  if (auto ok = Explain(log_.Sync()); !ok) return ok;
  std::error_code error;
  std::filesystem::rename(partial_, folder_, error);
  if (!error) return {};
  return Explain(FileSystemError(fmt::format("renaming {} to {}", partial_, folder_), error));
}

Result<void> DriveWriter::Explain(Result<void> result) const {
  if (result) return result;
  return Incomplete(std::move(result).error());
}

Error DriveWriter::Incomplete(Error error) const {
  error.message += fmt::format("; the drive is not complete, {} has a part of it", partial_);
  return error;
}

}  // namespace relocd
