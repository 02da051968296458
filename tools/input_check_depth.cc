#include <cmath>
#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "camera/measured_depth.h"
#include "camera/pinhole_camera.h"
#include "depth_file.h"
#include "input_check_parts.h"
#include "pose_conventions.h"
#include "track_geometry.h"

namespace relocd {
namespace {

/// Of the frames that have one, so many depth images are looked into.
constexpr std::size_t kLookedInto = 12;

std::vector<std::size_t> FramesWithDepth(const Dataset& dataset, InputFindings& findings) {
  std::vector<std::size_t> with;
  std::vector<std::size_t> without;
  for (std::size_t frame = 0; frame < dataset.frames.size(); ++frame)
    (dataset.frames[frame].depth_path.empty() ? without : with).push_back(frame);
  if (!with.empty() && !without.empty()) {
    findings.Warn("depth",
                  fmt::format("{} of {} images have no depth image in depth/ ({}): their depths "
                              "are looked for by the poses",
                              without.size(),
                              dataset.frames.size(),
                              NameFrames(dataset, without)));
  }
  return with;
}

using DepthByFrame = std::map<std::size_t, MeasuredDepth>;

/// Some of them, evenly chosen; nothing when one is refused.
DepthByFrame ReadSome(const Dataset& dataset,
                      const std::vector<std::size_t>& with,
                      InputFindings& findings) {
  DepthByFrame depths;
  for (std::size_t i = 0; i < std::min(kLookedInto, with.size()); ++i) {
    const std::size_t frame = with[i * with.size() / std::min(kLookedInto, with.size())];
    auto depth = ReadDepthFile(
        dataset.frames[frame].depth_path, dataset.intrinsics.width, dataset.intrinsics.height);
    if (!depth) {
      findings.Refuse("depth", depth.error().message);
      return {};
    }
    depths.emplace(frame, std::move(*depth));
  }
  return depths;
}

/// At corners, the measured depth over the one that follows from the poses.
std::vector<double> DepthFactors(const Dataset& dataset,
                                 const TrackedDrive& drive,
                                 const DepthByFrame& depths) {
  constexpr std::size_t kViews = 3;
  constexpr std::size_t kManySegments = 100'000;
  const SegmentScale scale = JudgingScale(dataset);
  const std::vector<FramePose> poses = PosesAsGiven(dataset);
  const PinholeCamera camera(dataset.intrinsics);
  std::vector<double> factors;
  for (const TrackSegment& segment :
       InformativeSegments(drive.tracks, kViews, scale, kManySegments)) {
    const auto depth = depths.find(segment.front().frame);
    if (depth == depths.end()) continue;
    const SegmentFit fit = FitSegment(segment, poses, scale);
    if (fit.error_px > scale.tolerance_px || fit.parallax_px < 2.0 * scale.tolerance_px) continue;
    const auto pixel = camera.Project(segment.front().ray.cast<double>().homogeneous());
    if (!pixel) continue;
    const auto measured =
        static_cast<double>(MeasuredInverseDepth(depth->second, pixel->cast<float>()));
    if (measured > 0.0) factors.push_back(fit.inverse_depth / measured);
  }
  return factors;
}

}  // namespace

void CheckDepthImages(const Dataset& dataset,
                      const TrackedDrive& drive,
                      InputSummary& summary,
                      InputFindings& findings) {
  constexpr std::size_t kEnough = 30;
  constexpr double kOff = 1.08;
  constexpr double kWrong = 1.3;
  const std::vector<std::size_t> with = FramesWithDepth(dataset, findings);
  const DepthByFrame depths = ReadSome(dataset, with, findings);
  const std::vector<double> factors = DepthFactors(dataset, drive, depths);
  if (factors.size() < kEnough) return;
  summary.depth_factor = MedianOf(factors);
  const double off = std::abs(std::log(*summary.depth_factor));
  if (off < std::log(kOff)) return;
  const std::string message = fmt::format(
      "things are {:.3g} times as far in the depth images as by the poses, at {} "
      "corners of {}: depths must be millimetres along the optical axis, of the pixels "
      "of the image",
      *summary.depth_factor,
      factors.size(),
      NameFrame(dataset, depths.begin()->first));
  if (off > std::log(kWrong)) {
    findings.Refuse("depth", message);
  } else {
    findings.Warn("depth", message);
  }
}

}  // namespace relocd
