#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/result.h"
#include "map_evaluation.h"
#include "map_training.h"

namespace relocd {

/// A held-out frame, and what the map made of it.
struct HeldOutFrame {
  std::string image;  ///< Path that can be opened.
  std::string name;   ///< Of the image in its drive.
  double along_m = 0.0;
  Eigen::Vector2d p_W = Eigen::Vector2d::Zero();  ///< Where it was taken, seen from above.
  std::size_t region = 0;                         ///< That gave the pose.
  std::optional<double> error_m;                  ///< Nothing where no pose was found.
  double error_rad = 0.0;
  double confidence = 0.0;
};

/// A part of the route where the map is bad.
struct WeakStretch {
  double begin_m = 0.0;
  double end_m = 0.0;
  std::size_t held_out = 0;  ///< Frames in it.
  std::size_t lost = 0;      ///< Of them without a pose.
  double worst_m = 0.0;      ///< Of those with one.
  std::size_t worst = 0;     ///< The frame of that, or a lost one: index into held_out.
  std::string first_image;
  std::string last_image;
};

/// A region of the route, and how it did.
struct RegionReport {
  std::string name;
  double begin_m = 0.0;
  double end_m = 0.0;
  std::size_t training_frames = 0;
  PoseErrors errors;  ///< Of the held-out frames whose pose it gave.
  double covariance_factor = 1.0;
  double confidence_threshold = 0.0;
  std::vector<LiveAccuracy> live;
};

/// How a training went: what people need to decide whether to drive again.
struct TrainingReport {
  std::string datasets;
  std::string how;  ///< Iterations, seed, time.
  double route_m = 0.0;
  PoseErrors errors;
  std::vector<RegionReport> regions;
  std::vector<HeldOutFrame> held_out;  ///< Along the route.
  std::vector<WeakStretch> weak;       ///< Worst first.
  std::vector<Eigen::Vector2d> path;   ///< The training frames from above, in their order.
};

TrainingReport MakeTrainingReport(const TrainedMap& trained, const MapTrainingOptions& options);

/// Stretches where held-out frames are lost, or off by more than most.
///
/// @param held_out  in order of along_m.
std::vector<WeakStretch> FindWeakStretches(const std::vector<HeldOutFrame>& held_out);

/// One line: what to drive again there.
std::string DescribeWeakStretch(const WeakStretch& stretch);

std::string FormatTrainingReport(const TrainingReport& report);

/// One page that needs nothing else, with the route, and the images of weak stretches.
Result<std::string> FormatTrainingReportHtml(const TrainingReport& report);

/// The route from above with the held-out frames coloured by their errors, as PNG.
std::string PlotTrainingReport(const TrainingReport& report, bool is_dark);

}  // namespace relocd
