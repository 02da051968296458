#include "messaging/bounded_decode.h"

namespace relocd {
namespace {

using Limits = MessageLimits;

constexpr std::size_t kInt32 = 4;
constexpr std::size_t kInt64 = 8;
constexpr std::size_t kDouble = 8;
constexpr std::size_t kHeader = 4 * kInt64;  // utime, mono_ns, seq, run_id

bool WalkProcess(WireWalker& walker) {
  return walker.String(Limits::kNameCharacters) && walker.Skip(4 * kInt32 + 3 * kDouble + kInt64) &&
         walker.String(Limits::kTextCharacters);
}

}  // namespace

bool WalkFields(WireWalker& walker, const camera_pose_t* /*type*/) {
  constexpr std::size_t kPose = (3 + 4 + 36) * kDouble;
  constexpr std::size_t kQuality = 3 * kInt32 + 2 * kDouble + 5 * kInt32;
  return walker.Skip(kHeader) && walker.String(Limits::kNameCharacters) &&
         walker.Skip(2 * kInt64) && walker.String(Limits::kNameCharacters) &&
         walker.Skip(2 * kInt32) && walker.String(Limits::kTextCharacters) &&
         walker.Skip(kPose + kQuality);
}

bool WalkFields(WireWalker& walker, const can_frames_t* /*type*/) {
  return walker.Skip(kHeader + 2 * kInt64 + kInt32) &&
         walker.Repeat(Limits::kCanFrames, [](WireWalker& frame) {
           return frame.Skip(kInt64 + kInt32) && frame.Bytes(Limits::kCanBytes);
         });
}

bool WalkFields(WireWalker& walker, const config_t* /*type*/) {
  return walker.Skip(kHeader) && walker.String(Limits::kNameCharacters) &&
         walker.String(Limits::kNameCharacters) && walker.String(Limits::kConfigCharacters);
}

bool WalkFields(WireWalker& walker, const image_t* /*type*/) {
  return walker.Skip(kInt64 + 4 * kInt32) && walker.Bytes(Limits::kImageBytes) &&
         walker.Repeat(Limits::kImageMetadata, [](WireWalker& metadata) {
           return metadata.String(Limits::kNameCharacters) &&
                  metadata.Bytes(Limits::kNameCharacters);
         });
}

bool WalkFields(WireWalker& walker, const localization_t* /*type*/) {
  constexpr std::size_t kPose = (3 + 9 + 2 + 4) * kDouble;
  return walker.Skip(kHeader + kInt32) && walker.String(Limits::kTextCharacters) &&
         walker.Skip(kPose + 7 * kInt64) && walker.String(Limits::kNameCharacters);
}

bool WalkFields(WireWalker& walker, const odometry_t* /*type*/) {
  constexpr std::size_t kMotion = (3 + 9 + 3 + 2) * kDouble;
  return walker.Skip(kHeader + kInt64 + kMotion + kInt32) &&
         walker.Repeat(Limits::kWheels, [](WireWalker& ticks) { return ticks.Skip(kInt64); });
}

bool WalkFields(WireWalker& walker, const status_t* /*type*/) {
  return walker.Skip(kHeader) && walker.String(Limits::kNameCharacters) && walker.Skip(kInt32) &&
         walker.String(Limits::kTextCharacters) && walker.String(Limits::kNameCharacters) &&
         walker.String(Limits::kNameCharacters) &&
         walker.Repeat(Limits::kStatusValues, [](WireWalker& value) {
           return value.String(Limits::kNameCharacters) && value.Skip(kDouble);
         });
}

bool WalkFields(WireWalker& walker, const supervisor_t* /*type*/) {
  return walker.Skip(kHeader) && walker.Repeat(Limits::kProcesses, WalkProcess);
}

bool WalkFields(WireWalker& walker, const text_t* /*type*/) {
  return walker.Skip(kHeader) && walker.String(Limits::kNameCharacters) && walker.Skip(kInt32) &&
         walker.String(Limits::kTextCharacters);
}

}  // namespace relocd
