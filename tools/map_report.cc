#include "map_report.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <iterator>
#include <utility>

#include <fmt/format.h>

namespace relocd {
namespace {

HeldOutFrame MakeHeldOut(const SceneMap& map,
                         const RouteFrame& frame,
                         const FrameLocalization& localization) {
  const Pose3 X_WC = Pose3(map.R_WD, Eigen::Vector3d::Zero()) * frame.frame.X_WC;
  HeldOutFrame held_out;
  held_out.image = frame.frame.image_path;
  held_out.name = std::filesystem::path(frame.frame.image_path).filename().string();
  held_out.along_m = frame.along_m;
  held_out.p_W = X_WC.translation().head<2>();
  held_out.region = localization.region;
  held_out.confidence = localization.pose.confidence;
  if (localization.pose.status == CameraPoseStatus::kOk) {
    const Pose3& found = localization.pose.X_WC;
    held_out.error_m = (found.translation() - X_WC.translation()).norm();
    held_out.error_rad = AngleBetween(found.rotation(), X_WC.rotation());
  }
  return held_out;
}

/// What a weak frame is compared with: errors of this size are usual on the map.
double UsualErrorM(const std::vector<HeldOutFrame>& held_out) {
  std::vector<double> errors;
  for (const HeldOutFrame& frame : held_out) {
    if (frame.error_m) errors.push_back(*frame.error_m);
  }
  return errors.empty() ? 0.0 : Quantile(std::move(errors), 0.5);
}

void AddTo(const HeldOutFrame& frame, std::size_t index, WeakStretch& stretch) {
  if (stretch.held_out == 0) {
    stretch.begin_m = frame.along_m;
    stretch.first_image = frame.name;
    stretch.worst = index;
  }
  ++stretch.held_out;
  stretch.end_m = frame.along_m;
  stretch.last_image = frame.name;
  if (!frame.error_m) {
    if (stretch.lost++ == 0) stretch.worst = index;
  } else if (*frame.error_m > stretch.worst_m) {
    stretch.worst_m = *frame.error_m;
    if (stretch.lost == 0) stretch.worst = index;
  }
}

RegionReport MakeRegionReport(const TrainedMap& trained, std::size_t index) {
  const MapRegion& region = trained.map.regions[index];
  RegionReport report;
  report.name = region.name;
  report.training_frames = region.training_poses.size();
  report.covariance_factor = region.calibration.covariance_factor;
  report.confidence_threshold = region.calibration.confidence_threshold;
  std::vector<FrameLocalization> of_region;
  for (const FrameLocalization& localization : trained.localizations) {
    if (localization.region == index) of_region.push_back(localization);
  }
  report.errors = MeasureErrors(trained.map, of_region);
  std::copy_if(trained.live.begin(),
               trained.live.end(),
               std::back_inserter(report.live),
               [&](const LiveAccuracy& live) { return live.region == index; });
  return report;
}

std::string FormatHeldOut(const PoseErrors& errors) {
  return fmt::format("{} of {} held-out images found: {}",
                     errors.localized,
                     errors.frames,
                     FormatAccuracy(errors));
}

}  // namespace

std::vector<WeakStretch> FindWeakStretches(const std::vector<HeldOutFrame>& held_out) {
  constexpr double kWeakM = 1.0;
  constexpr double kTimesUsual = 5.0;
  constexpr double kJoinM = 10.0;
  const double limit_m = std::max(kWeakM, kTimesUsual * UsualErrorM(held_out));
  std::vector<WeakStretch> stretches;
  for (std::size_t index = 0; index < held_out.size(); ++index) {
    const HeldOutFrame& frame = held_out[index];
    if (frame.error_m && *frame.error_m <= limit_m) continue;
    if (stretches.empty() || frame.along_m - stretches.back().end_m > kJoinM) {
      stretches.emplace_back();
    }
    AddTo(frame, index, stretches.back());
  }
  std::stable_sort(stretches.begin(), stretches.end(), [](const auto& a, const auto& b) {
    return std::pair(a.lost, a.worst_m) > std::pair(b.lost, b.worst_m);
  });
  return stretches;
}

std::string DescribeWeakStretch(const WeakStretch& stretch) {
  constexpr double kAroundM = 5.0;
  std::string what;
  if (stretch.lost > 0) what = fmt::format("{} not found", stretch.lost);
  if (stretch.lost < stretch.held_out) {
    what += fmt::format("{}{} off by up to {:.1f} m",
                        what.empty() ? "" : ", ",
                        stretch.held_out - stretch.lost,
                        stretch.worst_m);
  }
  const std::string images = stretch.held_out == 1
                                 ? stretch.first_image
                                 : fmt::format("{} to {}", stretch.first_image, stretch.last_image);
  return fmt::format("drive metres {:.0f} to {:.0f} again ({}): of the held-out images there {}",
                     std::max(0.0, stretch.begin_m - kAroundM),
                     stretch.end_m + kAroundM,
                     images,
                     what);
}

TrainingReport MakeTrainingReport(const TrainedMap& trained, const MapTrainingOptions& options) {
  TrainingReport report;
  report.datasets = trained.map.training.dataset;
  report.how = fmt::format("{} iterations of {}, seed {}, {:.0f} s, threads: {}",
                           options.head.iterations,
                           options.head.batch,
                           options.seed,
                           trained.seconds,
                           options.threads);
  report.errors = trained.held_out;
  std::size_t next = 0;
  for (const RouteFrame& frame : trained.route) {
    report.route_m = std::max(report.route_m, frame.along_m);
    const Pose3 X_WC = Pose3(trained.map.R_WD, Eigen::Vector3d::Zero()) * frame.frame.X_WC;
    if (frame.drive == 0) report.path.emplace_back(X_WC.translation().head<2>());
    if (frame.is_held_out) {
      report.held_out.push_back(MakeHeldOut(trained.map, frame, trained.localizations[next++]));
    }
  }
  std::stable_sort(report.held_out.begin(),
                   report.held_out.end(),
                   [](const auto& a, const auto& b) { return a.along_m < b.along_m; });
  const auto stretches =
      DivideRoute(trained.route, options.region_length_m, options.region_overlap_m);
  for (std::size_t index = 0; index < trained.map.regions.size(); ++index) {
    RegionReport region = MakeRegionReport(trained, index);
    const auto& frames = stretches[index].training;
    const auto [first, last] = std::minmax_element(
        frames.begin(), frames.end(), [](const RouteFrame& a, const RouteFrame& b) {
          return a.along_m < b.along_m;
        });
    if (!frames.empty()) {
      region.begin_m = first->along_m;
      region.end_m = last->along_m;
    }
    report.regions.push_back(std::move(region));
  }
  report.weak = FindWeakStretches(report.held_out);
  return report;
}

std::string FormatTrainingReport(const TrainingReport& report) {
  std::string text = fmt::format("held-out training frames: {}\n", FormatHeldOut(report.errors));
  auto out = std::back_inserter(text);
  fmt::format_to(out, "{}, {:.0f} m, {}\n", report.datasets, report.route_m, report.how);
  for (const RegionReport& region : report.regions) {
    fmt::format_to(out,
                   "{}: {:.0f} to {:.0f} m, {} training frames; {}; covariance factor {:.1f}, "
                   "confidence threshold {:.3f}\n",
                   region.name,
                   region.begin_m,
                   region.end_m,
                   region.training_frames,
                   FormatHeldOut(region.errors),
                   region.covariance_factor,
                   region.confidence_threshold);
    for (const LiveAccuracy& live : region.live) {
      fmt::format_to(out,
                     "{}: after {} iterations {} of {} found, median {:.2f} m\n",
                     region.name,
                     live.iteration,
                     live.localized,
                     live.frames,
                     live.median_m);
    }
  }
  for (const WeakStretch& stretch : report.weak)
    fmt::format_to(out, "weak: {}\n", DescribeWeakStretch(stretch));
  if (report.weak.empty()) text += "weak: nowhere; nothing needs to be driven again\n";
  return text;
}

}  // namespace relocd
