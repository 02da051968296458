#include "inferenced/inference_node.h"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>
#include <limits>
#include <span>
#include <utility>

#include <fmt/format.h>

#include "relocd/camera_pose_t.hpp"

#include "camera/jpeg.h"
#include "geometry/planar.h"

namespace relocd {
namespace {

constexpr std::size_t kMapIdDigits = 16;
/// A localization that is farther from the image's time says little about it.
constexpr double kLongestPredictionS = 2.0;
constexpr std::int32_t kMjpeg = 0x47504A4D;  // "MJPG"

/// The number that the first digits of a hash spell.
std::uint64_t SeedOf(const std::string& map_id) {
  std::uint64_t seed = 0;
  const char* const begin = map_id.data();
  std::from_chars(begin, begin + std::min(map_id.size(), kMapIdDigits), seed, 16);
  return seed;
}

std::int32_t Microseconds(Duration duration) {
  const auto us = std::chrono::duration_cast<std::chrono::microseconds>(duration).count();
  return static_cast<std::int32_t>(
      std::clamp<std::int64_t>(us, 0, std::numeric_limits<std::int32_t>::max()));
}

std::int32_t StatusOf(CameraPoseStatus status) {
  switch (status) {
    case CameraPoseStatus::kOk:
      return camera_pose_t::STATUS_OK;
    case CameraPoseStatus::kNoHypothesis:
      return camera_pose_t::STATUS_NO_HYPOTHESIS;
    case CameraPoseStatus::kLowConfidence:
      return camera_pose_t::STATUS_LOW_CONFIDENCE;
    case CameraPoseStatus::kDegenerate:
      return camera_pose_t::STATUS_DEGENERATE;
    case CameraPoseStatus::kOffRoute:
      return camera_pose_t::STATUS_OFF_ROUTE;
  }
  return camera_pose_t::STATUS_NO_HYPOTHESIS;
}

std::string Explain(const CameraPoseResult& result) {
  switch (result.status) {
    case CameraPoseStatus::kOk:
      return "";
    case CameraPoseStatus::kNoHypothesis:
      return fmt::format("none of the poses tried fits four of {} scene coordinates",
                         result.correspondences);
    case CameraPoseStatus::kLowConfidence:
      return fmt::format("confidence {:.3f}, {} of {} scene coordinates agree",
                         result.confidence,
                         result.inliers,
                         result.correspondences);
    case CameraPoseStatus::kDegenerate:
      return fmt::format("the {} scene coordinates that agree do not determine a pose",
                         result.inliers);
    case CameraPoseStatus::kOffRoute:
      return fmt::format("{} scene coordinates agree on a pose far from where the map was learned",
                         result.inliers);
  }
  return "";
}

void SetPose(const CameraPoseResult& result, camera_pose_t& answer) {
  answer.correspondences = result.correspondences;
  answer.inliers = result.inliers;
  answer.hypotheses = result.hypotheses;
  answer.reprojection_rms_px = result.reprojection_rms_px;
  answer.confidence = result.confidence;
  answer.status = StatusOf(result.status);
  answer.message = Explain(result);
  if (result.status != CameraPoseStatus::kOk) return;
  Eigen::Map<Eigen::Vector3d>(answer.pos) = result.X_WC.translation();
  const Eigen::Quaterniond& rotation = result.X_WC.rotation();
  Eigen::Map<Eigen::Vector4d>(answer.quat) << rotation.w(), rotation.vec();
  Eigen::Map<Matrix6d>(answer.covariance) = result.covariance;  // symmetric: the order is the same
}

void SetReason(std::int32_t status, std::string message, camera_pose_t& answer) {
  answer.status = status;
  answer.message = std::move(message);
}

camera_pose_t EmptyAnswer() {
  camera_pose_t answer{};
  answer.quat[0] = 1.0;
  answer.region = -1;
  return answer;
}

}  // namespace

InferenceNode::InferenceNode(const InferenceConfig& config,
                             std::unique_ptr<ImageLocalizer> localizer,
                             std::map<std::string, Pose3> X_BCs,
                             MessageBus& bus,
                             std::int64_t run_id,
                             Clock clock)
    : config_(config),
      localizer_(std::move(localizer)),
      X_BCs_(std::move(X_BCs)),
      bus_(bus),
      run_id_(run_id),
      clock_(std::move(clock)),
      map_seed_(SeedOf(localizer_->map_id())) {}

void InferenceNode::Handle(const std::string& camera, const image_t& image) {
  const ClockReading start = clock_();
  ++counters_.images;
  last_image_ = start.monotonic;
  const std::optional<ImageMetadata> metadata = FindImageMetadata(image);

  camera_pose_t answer = EmptyAnswer();
  answer.utime = image.utime;
  answer.run_id = run_id_;
  answer.camera = camera;
  answer.map_id = localizer_->map_id().substr(0, kMapIdDigits);
  if (metadata) {
    answer.mono_ns = metadata->mono_ns;
    answer.image_seq = metadata->seq;
    answer.image_run_id = metadata->run_id;
    const Duration age = start.monotonic - FromNanoseconds(metadata->mono_ns);
    const std::chrono::milliseconds max_age(config_.max_image_age_ms);
    if (max_age.count() > 0 && age > max_age) {
      ++counters_.too_old;
      return;
    }
    Localize(image, answer);
  } else {
    SetReason(camera_pose_t::STATUS_BAD_IMAGE,
              "the image's metadata has no mono_ns, seq and run_id",
              answer);
  }

  answer.seq = next_seq_++;
  const MonotonicTime end = clock_().monotonic;
  if (metadata) {
    const Duration age = end - FromNanoseconds(metadata->mono_ns);
    answer.age_us = Microseconds(age);
    age_ms_.Add(1e3 * ToSeconds(age));
  }
  work_ms_.Add(1e3 * ToSeconds(end - start.monotonic));
  Count(answer, end);
  if (auto ok = bus_.Publish(channels::kCameraPose, answer); !ok) ++counters_.unpublished;
}

void InferenceNode::Handle(const localization_t& localization) {
  localization_.reset();
  switch (localization.status) {
    case localization_t::CONVERGING:
    case localization_t::OK:
    case localization_t::DEAD_RECKONING:
      break;
    default:  // there is no pose, or it is not to be believed
      return;
  }
  const Eigen::Map<const Eigen::Matrix3d> covariance(localization.covariance);
  const Eigen::Vector3d pose(localization.x_WB_m, localization.y_WB_m, localization.yaw_WB_rad);
  if (pose.allFinite() && covariance.allFinite()) localization_ = localization;
}

std::optional<CameraPrior> InferenceNode::Prior(const std::string& camera,
                                                MonotonicTime image_time) const {
  if (!localization_) return std::nullopt;
  const auto mounting = X_BCs_.find(camera);
  if (mounting == X_BCs_.end()) return std::nullopt;
  const double ahead_s = ToSeconds(image_time - FromNanoseconds(localization_->mono_ns));
  if (!(std::abs(ahead_s) < kLongestPredictionS)) return std::nullopt;
  const Pose2 X_WB(localization_->x_WB_m, localization_->y_WB_m, localization_->yaw_WB_rad);
  const Pose2 moved = X_WB * Pose2::Exp({localization_->speed_mps * ahead_s,
                                         0.0,
                                         localization_->yaw_rate_radps * ahead_s});
  const Eigen::Map<const Eigen::Matrix3d> covariance(localization_->covariance);
  return CameraPrior{.X_WC = LiftFromPlane(moved) * mounting->second,
                     .sigma_m = std::sqrt(std::max(0.0, covariance.topLeftCorner<2, 2>().trace())),
                     .sigma_rad = std::sqrt(std::max(0.0, covariance(2, 2)))};
}

void InferenceNode::Localize(const image_t& image, camera_pose_t& answer) {
  if (image.pixelformat != kMjpeg) {
    return SetReason(
        camera_pose_t::STATUS_BAD_IMAGE,
        fmt::format("pixel format {:#010x}, must be MJPG ({:#010x})", image.pixelformat, kMjpeg),
        answer);
  }
  const MonotonicTime start = clock_().monotonic;
  const std::span<const std::uint8_t> jpeg(image.data);
  const Result<JpegSize> size = ReadJpegSize(jpeg);
  if (!size) {
    return SetReason(camera_pose_t::STATUS_BAD_IMAGE, size.error().message, answer);
  }
  const JpegSize expected{localizer_->camera().width, localizer_->camera().height};
  if (*size != expected) {
    return SetReason(camera_pose_t::STATUS_WRONG_SIZE,
                     fmt::format("the image is {} x {} px, the map is for {} x {} px",
                                 size->width,
                                 size->height,
                                 expected.width,
                                 expected.height),
                     answer);
  }
  const Result<GrayImage> gray = DecodeJpegToGray(jpeg);
  if (!gray) {
    return SetReason(camera_pose_t::STATUS_BAD_IMAGE, gray.error().message, answer);
  }
  answer.decode_us = Microseconds(clock_().monotonic - start);

  const std::uint64_t seed = map_seed_ ^ static_cast<std::uint64_t>(answer.image_seq);
  const std::optional<CameraPrior> prior = Prior(answer.camera, FromNanoseconds(answer.mono_ns));
  const Result<ImageLocalization> localization =
      localizer_->Localize(*gray, prior, seed, [this] { return clock_().monotonic; });
  if (!localization) {
    return SetReason(camera_pose_t::STATUS_BAD_IMAGE, localization.error().message, answer);
  }
  answer.features_us = Microseconds(localization->features_time);
  answer.head_us = Microseconds(localization->head_time);
  answer.pose_us = Microseconds(localization->pose_time);
  answer.region = localization->region;
  counters_.regions_tried += localization->regions_tried;
  if (prior) ++counters_.priors;
  SetPose(localization->pose, answer);
}

void InferenceNode::Count(const camera_pose_t& answer, MonotonicTime now) {
  last_reason_ = answer.message;
  switch (answer.status) {
    case camera_pose_t::STATUS_OK:
      ++counters_.poses;
      last_pose_ = now;
      return;
    case camera_pose_t::STATUS_BAD_IMAGE:
      ++counters_.bad;
      return;
    case camera_pose_t::STATUS_WRONG_SIZE:
      ++counters_.wrong_size;
      return;
    case camera_pose_t::STATUS_NO_HYPOTHESIS:
      ++counters_.no_hypothesis;
      return;
    case camera_pose_t::STATUS_LOW_CONFIDENCE:
      ++counters_.low_confidence;
      return;
    case camera_pose_t::STATUS_OFF_ROUTE:
      ++counters_.off_route;
      return;
    default:
      ++counters_.degenerate;
  }
}

void InferenceNode::RaiseLevel(const ClockReading& now, NodeStatus& status) const {
  constexpr double kPatience = 2.0;
  if (!last_image_) {
    status.Raise(status_t::WARNING, "no image yet");
    return;
  }
  if (const double age_s = ToSeconds(now.monotonic - *last_image_); age_s > kPatience) {
    status.Raise(status_t::WARNING, fmt::format("no image for {:.1f} s", age_s));
    return;
  }
  if (last_reason_.empty()) return;
  if (!last_pose_) {
    status.Raise(status_t::WARNING, fmt::format("no pose yet: {}", last_reason_));
    return;
  }
  if (const double age_s = ToSeconds(now.monotonic - *last_pose_); age_s > kPatience) {
    status.Raise(status_t::WARNING, fmt::format("no pose for {:.1f} s: {}", age_s, last_reason_));
  }
}

NodeStatus InferenceNode::Status(const ClockReading& now) const {
  NodeStatus status;
  const auto add = [&status](const char* name, std::int64_t count) {
    status.Add(name, static_cast<double>(count));
  };
  add("images", counters_.images);
  add("images_too_old", counters_.too_old);
  add("images_bad", counters_.bad);
  add("images_wrong_size", counters_.wrong_size);
  add("no_hypothesis", counters_.no_hypothesis);
  add("low_confidence", counters_.low_confidence);
  add("degenerate", counters_.degenerate);
  add("off_route", counters_.off_route);
  add("poses", counters_.poses);
  add("regions_tried", counters_.regions_tried);
  add("priors", counters_.priors);
  add("unpublished", counters_.unpublished);
  status.Add("image_to_pose_p50_ms", age_ms_.Percentile(0.50));
  status.Add("image_to_pose_p99_ms", age_ms_.Percentile(0.99));
  status.Add("work_p50_ms", work_ms_.Percentile(0.50));
  status.Add("work_p99_ms", work_ms_.Percentile(0.99));
  status.Add("bfloat16", localizer_->uses_bfloat16() ? 1.0 : 0.0);
  RaiseLevel(now, status);
  return status;
}

}  // namespace relocd
