#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "input_check_parts.h"

namespace relocd {
namespace {

/// Frames that a measure calls bad, and what to say of them.
struct ImageFault {
  const char* about;
  const char* what;
  const char* remedy;
};

void Report(const ImageFault& fault,
            const Dataset& dataset,
            const std::vector<std::size_t>& frames,
            InputFindings& findings) {
  if (frames.empty()) return;
  findings.Warn(fault.about,
                fmt::format("{} of {} images {} ({}): {}",
                            frames.size(),
                            dataset.frames.size(),
                            fault.what,
                            NameFrames(dataset, frames),
                            fault.remedy));
}

template <typename IsBad>
std::vector<std::size_t> FramesWhere(const TrackedDrive& drive, const IsBad& is_bad) {
  std::vector<std::size_t> frames;
  for (std::size_t frame = 0; frame < drive.images.size(); ++frame) {
    if (drive.images[frame].looked_at && is_bad(frame)) frames.push_back(frame);
  }
  return frames;
}

/// Of the images around a frame.
double SharpnessAround(const TrackedDrive& drive, std::size_t frame) {
  constexpr std::size_t kAround = 6;
  std::vector<double> around;
  const std::size_t begin = frame < kAround ? 0 : frame - kAround;
  const std::size_t end = std::min(drive.images.size(), frame + kAround + 1);
  for (std::size_t i = begin; i < end; ++i) {
    if (drive.images[i].looked_at) around.push_back(drive.images[i].sharpness);
  }
  return MedianOf(around);
}

void CheckBlur(const Dataset& dataset,
               const TrackedDrive& drive,
               double usual_px,
               InputFindings& findings) {
  constexpr double kLeastOfUsual = 0.5;
  constexpr double kAllBlurredPx = 1.8;
  if (usual_px > kAllBlurredPx) {
    findings.Warn("blur",
                  fmt::format("the images are blurred throughout, by {:.1f} px in the median, "
                              "should be below {} px: focus the lens, clean it, expose shorter",
                              usual_px,
                              kAllBlurredPx));
    return;
  }
  const auto blurred = FramesWhere(drive, [&](std::size_t frame) {
    return drive.images[frame].sharpness < kLeastOfUsual * SharpnessAround(drive, frame);
  });
  Report({"blur",
          "are blurred more than those around them",
          "drive slower there or expose shorter; take their rows out"},
         dataset,
         blurred,
         findings);
}

void CheckExposure(const Dataset& dataset, const TrackedDrive& drive, InputFindings& findings) {
  constexpr double kDark = 45.0;
  constexpr double kBright = 200.0;
  constexpr double kFlat = 25.0;
  constexpr double kJump = 1.5;
  const auto& images = drive.images;
  Report({"exposure", "are nearly black", "expose longer, or drive in better light"},
         dataset,
         FramesWhere(drive, [&](std::size_t i) { return images[i].light_level < kDark; }),
         findings);
  Report({"exposure", "are nearly white", "expose shorter, or leave it to the camera"},
         dataset,
         FramesWhere(drive, [&](std::size_t i) { return images[i].dark_level > kBright; }),
         findings);
  Report({"exposure", "have next to no contrast", "look for fog or dirt on the lens"},
         dataset,
         FramesWhere(drive,
                     [&](std::size_t i) {
                       return images[i].light_level >= kDark && images[i].dark_level <= kBright &&
                              images[i].light_level - images[i].dark_level < kFlat;
                     }),
         findings);
  Report({"exposure",
          "are much brighter or darker than the image before",
          "make the camera's exposure control slower"},
         dataset,
         FramesWhere(drive,
                     [&](std::size_t i) {
                       if (i == 0 || !images[i - 1].looked_at) return false;
                       const double a = images[i].mean_level + 1.0;
                       const double b = images[i - 1].mean_level + 1.0;
                       return std::max(a, b) / std::min(a, b) > kJump;
                     }),
         findings);
}

/// Images and poses that do not move together.
void CheckHanging(const Dataset& dataset,
                  const TrackedDrive& drive,
                  double usual_m,
                  InputFindings& findings) {
  constexpr double kStillPx = 0.15;
  constexpr double kMovingPx = 3.0;
  constexpr double kMovingShare = 0.3;
  const auto step_m = [&](std::size_t i) {
    return (dataset.frames[i].X_WC.translation() - dataset.frames[i - 1].X_WC.translation()).norm();
  };
  Report({"images",
          "show what the image before shows although the poses travel",
          "the camera or the recording hung; take their rows out"},
         dataset,
         FramesWhere(drive,
                     [&](std::size_t i) {
                       const double motion_px = drive.images[i].motion_px;
                       return i > 0 && motion_px >= 0.0 && motion_px < kStillPx &&
                              step_m(i) > kMovingShare * usual_m;
                     }),
         findings);
  Report({"poses",
          "move although their pose is that of the image before",
          "the reference for the poses hung; give the frames poses, or take their rows out"},
         dataset,
         FramesWhere(drive,
                     [&](std::size_t i) {
                       if (i == 0 || drive.images[i].motion_px < kMovingPx) return false;
                       const Pose3 moved =
                           dataset.frames[i - 1].X_WC.Inverse() * dataset.frames[i].X_WC;
                       constexpr double kSame = 1e-6;
                       return moved.Log().norm() < kSame;
                     }),
         findings);
}

}  // namespace

void CheckImageQuality(const Dataset& dataset,
                       const TrackedDrive& drive,
                       InputSummary& summary,
                       InputFindings& findings) {
  constexpr int kFewCorners = 25;
  std::vector<double> blurs;
  std::vector<double> corners;
  for (const ImageQuality& image : drive.images) {
    if (!image.looked_at) continue;
    blurs.push_back(image.blur_px);
    corners.push_back(image.corners);
  }
  summary.images_looked_at = drive.images_looked_at;
  summary.blur_px = MedianOf(blurs);
  summary.corners = MedianOf(corners);
  CheckBlur(dataset, drive, summary.blur_px, findings);
  CheckExposure(dataset, drive, findings);
  Report({"texture",
          "show hardly anything that could be recognised",
          "point the camera where there is more to see; nothing can be found there"},
         dataset,
         FramesWhere(drive, [&](std::size_t i) { return drive.images[i].corners < kFewCorners; }),
         findings);
  CheckHanging(dataset, drive, summary.median_step_m, findings);
}

}  // namespace relocd
