#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "input_check_parts.h"

namespace relocd {
namespace {

constexpr std::size_t kMinFrames = 8;
constexpr std::size_t kFewFrames = 40;
constexpr double kMinRouteM = 0.5;
constexpr double kNanosecond = 1e-9;

/// From one frame to the next.
struct Step {
  double metres = 0.0;
  double seconds = 0.0;
  int rows = 1;  ///< More where a split or a selection left some out.
};

std::vector<Step> StepsOf(const Dataset& dataset) {
  std::vector<Step> steps;
  for (std::size_t i = 1; i < dataset.frames.size(); ++i) {
    const DatasetFrame& before = dataset.frames[i - 1];
    const DatasetFrame& here = dataset.frames[i];
    steps.push_back({(here.X_WC.translation() - before.X_WC.translation()).norm(),
                     kNanosecond * static_cast<double>(here.time_ns - before.time_ns),
                     here.index - before.index});
  }
  return steps;
}

/// Of steps that are not of standing.
double MedianMovingStep(const std::vector<Step>& steps) {
  double longest = 0.0;
  for (const Step& step : steps)
    longest = std::max(longest, step.metres / step.rows);
  std::vector<double> moving;
  constexpr double kStandingShare = 0.01;
  for (const Step& step : steps) {
    const double metres = step.metres / step.rows;
    if (metres > kStandingShare * longest) moving.push_back(metres);
  }
  return MedianOf(moving);
}

void CheckGaps(const Dataset& dataset,
               const std::vector<Step>& steps,
               double usual_m,
               InputFindings& findings) {
  constexpr double kGapSteps = 6.0;
  constexpr std::size_t kMaxNamed = 3;
  std::vector<std::string> gaps;
  double missing_m = 0.0;
  for (std::size_t i = 0; i < steps.size(); ++i) {
    if (steps[i].metres / steps[i].rows < kGapSteps * usual_m) continue;
    missing_m += steps[i].metres;
    gaps.push_back(fmt::format("{:.1f} m from {} to {}",
                               steps[i].metres,
                               NameFrame(dataset, i),
                               NameFrame(dataset, i + 1)));
  }
  if (gaps.empty()) return;
  const std::size_t named = std::min(kMaxNamed, gaps.size());
  std::string list = fmt::format(
      "{}", fmt::join(gaps.begin(), gaps.begin() + static_cast<std::ptrdiff_t>(named), ", "));
  if (named < gaps.size()) list += fmt::format(" and {} more", gaps.size() - named);
  findings.Warn("gaps",
                fmt::format("no images for {:.1f} m ({}), where {:.2f} m are usual: the map will "
                            "not know these stretches; drive them again, or mend the poses if they "
                            "jump there",
                            missing_m,
                            list,
                            usual_m));
}

void CheckStanding(const Dataset& dataset,
                   const std::vector<Step>& steps,
                   double usual_m,
                   InputFindings& findings) {
  constexpr double kStandingShare = 0.02;
  constexpr double kMuch = 0.3;
  std::vector<std::size_t> standing;
  for (std::size_t i = 0; i < steps.size(); ++i) {
    const Pose3 turn = dataset.frames[i].X_WC.Inverse() * dataset.frames[i + 1].X_WC;
    constexpr double kTurnedRad = 1e-3;
    if (steps[i].metres < kStandingShare * usual_m && turn.Log().tail<3>().norm() < kTurnedRad) {
      standing.push_back(i + 1);
    }
  }
  if (static_cast<double>(standing.size()) < kMuch * static_cast<double>(steps.size())) return;
  findings.Warn("standing",
                fmt::format("{} of {} images were taken while the vehicle stood ({}): they cost "
                            "time and teach nothing; take most of their rows out",
                            standing.size(),
                            dataset.frames.size(),
                            NameFrames(dataset, standing)));
}

void CheckPace(const std::vector<Step>& steps, double usual_m, InputFindings& findings) {
  constexpr double kFarM = 2.5;
  constexpr double kFastMps = 60.0;
  constexpr double kSlowMps = 0.01;
  std::vector<double> speeds;
  for (const Step& step : steps) {
    if (step.seconds > 0.0 && step.metres > 0.0) speeds.push_back(step.metres / step.seconds);
  }
  const double speed_mps = MedianOf(speeds);
  if (!speeds.empty() && (speed_mps > kFastMps || speed_mps < kSlowMps)) {
    findings.Warn(
        "scale",
        fmt::format("by poses and times the camera moves at {:.3g} m/s, expected {} to {} "
                    "m/s: are the positions in metres, and the times in seconds?",
                    speed_mps,
                    kSlowMps,
                    kFastMps));
  } else if (usual_m > kFarM) {
    findings.Warn(
        "spacing",
        fmt::format("the images are {:.1f} m apart, should be at most {} m: drive slower, "
                    "or record more images a second",
                    usual_m,
                    kFarM));
  }
}

}  // namespace

void CheckRoute(const Dataset& dataset, InputSummary& summary, InputFindings& findings) {
  const std::vector<Step> steps = StepsOf(dataset);
  summary.frames = dataset.frames.size();
  for (const Step& step : steps) {
    summary.route_m += step.metres;
    summary.duration_s += step.seconds;
  }
  summary.median_step_m = MedianMovingStep(steps);
  if (dataset.frames.size() < kMinFrames) {
    findings.Refuse("frames",
                    fmt::format("{} training frames, must be at least {}: record the whole route",
                                dataset.frames.size(),
                                kMinFrames));
    return;
  }
  if (summary.route_m < kMinRouteM) {
    findings.Refuse("route",
                    fmt::format("the camera travels {:.3f} m, must be at least {} m: depths need "
                                "views from different places; are the positions in metres?",
                                summary.route_m,
                                kMinRouteM));
    return;
  }
  if (dataset.frames.size() < kFewFrames) {
    findings.Warn(
        "frames",
        fmt::format("{} frames are few, {} and more make a map worth driving with: record "
                    "more images a second, or a longer stretch",
                    dataset.frames.size(),
                    kFewFrames));
  }
  CheckGaps(dataset, steps, summary.median_step_m, findings);
  CheckStanding(dataset, steps, summary.median_step_m, findings);
  CheckPace(steps, summary.median_step_m, findings);
}

}  // namespace relocd
