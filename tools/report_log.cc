#include "report_log.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "log_summary.h"
#include "messaging/image_metadata.h"
#include "messaging/message_bus.h"
#include "recording/log_reader.h"

namespace relocd {
namespace {

bool IsImage(const LogEvent& event) {
  return event.channel.starts_with(ImageChannel("").name);
}

std::optional<std::int64_t> TimeOf(const image_t& image) {
  const auto metadata = FindImageMetadata(image);
  if (!metadata) return std::nullopt;
  return metadata->mono_ns;
}

/// What the daemons said last, by `daemon.value`.
using StatusValues = std::map<std::string, double>;

void AddStatus(const LogEvent& event, StatusValues& values) {
  if (!event.channel.starts_with(StatusChannel("").name)) return;
  const auto status = DecodeBounded<status_t>(event.data);
  if (!status) return;
  for (const status_value_t& value : status->values)
    values[status->daemon + "." + value.name] = value.value;
}

void AddRecorded(const LogSummary& summary,
                 const std::string& channel,
                 ReportedLatency latency,
                 std::vector<ReportedLatency>& latencies) {
  constexpr double kHigh = 0.99;
  latency.p50_ms = summary.AgePercentileMs(channel, 0.5);
  latency.p99_ms = summary.AgePercentileMs(channel, kHigh);
  if (std::isfinite(latency.p50_ms)) latencies.push_back(std::move(latency));
}

void AddReported(const StatusValues& values,
                 const std::string& value,
                 ReportedLatency latency,
                 std::vector<ReportedLatency>& latencies) {
  const auto p50 = values.find(value + "_p50_ms");
  const auto p99 = values.find(value + "_p99_ms");
  if (p50 == values.end() || p99 == values.end()) return;
  latency.p50_ms = p50->second;
  latency.p99_ms = p99->second;
  latencies.push_back(std::move(latency));
}

}  // namespace

Result<LogFacts> ReadLogFacts(const std::string& path, std::int64_t time_origin_ns) {
  auto reader = LogReader::Open(path);
  if (!reader) return std::move(reader).error();
  LogFacts facts;
  LogSummary summary;
  StatusValues values;
  while (const auto event = reader->Next()) {
    summary.Add(*event);
    AddStatus(*event, values);
    if (!IsImage(*event)) continue;
    const auto image = DecodeBounded<image_t>(event->data);
    const auto time_ns = image ? TimeOf(*image) : std::nullopt;
    if (time_ns) facts.image_times_ns.push_back(*time_ns - time_origin_ns);
  }
  facts.messages = reader->counters().events;
  facts.lost = summary.Lost();
  if (facts.messages == 0) {
    return Error{ErrorKind::kInvalidInput,
                 path + ": has no message, must be a log of recorderd or lcm-logger"};
  }
  AddRecorded(summary,
              channels::kPose.name,
              {.key = "can_to_pose", .name = "CAN frame to POSE, at the recorder"},
              facts.latencies);
  AddReported(values,
              "odometryd.frame_to_odometry",
              {.key = "can_to_odometry", .name = "CAN frame to ODOMETRY, by odometryd"},
              facts.latencies);
  AddRecorded(summary,
              channels::kCameraPose.name,
              {.key = "image_to_camera_pose", .name = "image to CAMERA_POSE, at the recorder"},
              facts.latencies);
  AddReported(
      values,
      "inferenced.image_to_pose",
      {.key = "image_to_camera_pose_reported", .name = "image to CAMERA_POSE, by inferenced"},
      facts.latencies);
  return facts;
}

Result<std::vector<std::string>> ReadLogImages(const std::string& path,
                                               std::int64_t time_origin_ns,
                                               const std::vector<std::int64_t>& times_ns) {
  auto reader = LogReader::Open(path);
  if (!reader) return std::move(reader).error();
  std::vector<std::string> images(times_ns.size());
  while (const auto event = reader->Next()) {
    if (!IsImage(*event)) continue;
    const auto image = DecodeBounded<image_t>(event->data);
    const auto time_ns = image ? TimeOf(*image) : std::nullopt;
    if (!time_ns) continue;
    const auto wanted = std::ranges::find(times_ns, *time_ns - time_origin_ns);
    if (wanted == times_ns.end()) continue;
    images[static_cast<std::size_t>(wanted - times_ns.begin())].assign(image->data.begin(),
                                                                       image->data.end());
  }
  return images;
}

}  // namespace relocd
