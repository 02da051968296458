#include "camerad/camera_node.h"

#include <algorithm>
#include <chrono>
#include <iterator>
#include <utility>

#include <fmt/format.h>

#include "messaging/image_message.h"

namespace relocd {
namespace {

constexpr Duration kRateWindow = std::chrono::seconds(2);

}  // namespace

CameraNode::CameraNode(const std::string& camera,
                       const CameraConfig& config,
                       FrameSource& source,
                       MessageBus& bus,
                       std::int64_t run_id)
    : channel_(ImageChannel(camera)),
      config_(config),
      source_(source),
      bus_(bus),
      run_id_(run_id) {}

void CameraNode::HandleSource(const ClockReading& now) {
  if (auto frame = source_.Next(now.monotonic)) Publish(*std::move(frame), now);
  while (!published_.empty() && published_.front() < now.monotonic - kRateWindow)
    published_.pop_front();
}

void CameraNode::Publish(Frame frame, const ClockReading& now) {
  if (frame.bytes.size() > kOneDatagramBytes && oversize_++ == 0) {
    notices_.push_back(
        fmt::format("an image has {} bytes, above {} it is easily lost: lower the camera's size, "
                    "jpeg_quality or max_jpeg_bytes",
                    frame.bytes.size(),
                    kOneDatagramBytes));
  }
  width_ = frame.width;
  height_ = frame.height;
  image_bytes_ = frame.bytes.size();
  age_ = now.monotonic - frame.time;

  const ImageStamp stamp{.utime = now.RealtimeUsAt(frame.time), .seq = seq_++, .run_id = run_id_};
  const image_t message = ToMessage(std::move(frame), stamp);
  const auto sent = bus_.Publish(channel_, message);
  publish_error_ = sent ? "" : sent.error().message;
  if (!sent) ++publish_failures_;
  published_.push_back(now.monotonic);
}

NodeStatus CameraNode::Status(const ClockReading& now) const {
  NodeStatus status;
  if (!source_.problem().empty()) {
    status.Raise(status_t::ERROR, "no frames: " + source_.problem());
  }
  if (!source_.remark().empty()) status.Raise(status_t::WARNING, source_.remark());
  if (!publish_error_.empty()) status.Raise(status_t::ERROR, publish_error_);
  const bool is_other_size = width_ != config_.width || height_ != config_.height;
  if (config_.driver == "v4l2" && seq_ > 0 && is_other_size) {
    status.Raise(status_t::WARNING,
                 fmt::format("images are {} x {} px, the config asks for {} x {}",
                             width_,
                             height_,
                             config_.width,
                             config_.height));
  }
  if (image_bytes_ > kOneDatagramBytes) {
    status.Raise(
        status_t::WARNING,
        fmt::format(
            "images have {} bytes, above {} are easily lost", image_bytes_, kOneDatagramBytes));
  }
  const FrameCounters& counters = source_.counters();
  const auto recent = std::ranges::count_if(
      published_, [&](MonotonicTime time) { return time >= now.monotonic - kRateWindow; });
  status.Add("frames", static_cast<double>(seq_));
  status.Add("frame_rate_hz", static_cast<double>(recent) / ToSeconds(kRateWindow));
  status.Add("frames_dropped", static_cast<double>(counters.dropped));
  status.Add("frames_damaged", static_cast<double>(counters.damaged));
  status.Add("frames_oversize", static_cast<double>(oversize_));
  status.Add("publish_failures", static_cast<double>(publish_failures_));
  status.Add("stream_restarts", static_cast<double>(counters.stalls));
  status.Add("device_reopened", static_cast<double>(counters.reopened));
  status.Add("image_bytes", static_cast<double>(image_bytes_));
  status.Add("image_age_ms", ToSeconds(age_) * 1e3);
  status.Add("recording_ended", source_.ended() ? 1.0 : 0.0);
  return status;
}

std::vector<std::string> CameraNode::TakeNotices() {
  std::vector<std::string> notices = source_.TakeNotices();
  std::move(notices_.begin(), notices_.end(), std::back_inserter(notices));
  notices_.clear();
  return notices;
}

}  // namespace relocd
