#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <fmt/format.h>

#include "input_check_parts.h"
#include "pose_conventions.h"
#include "track_geometry.h"

namespace relocd {
namespace {

constexpr double kDegrees = 180.0 / std::numbers::pi;
/// With less, poses and images contradict each other; a right drive among traffic has 0.85 to 1.
constexpr double kLeastShare = 0.5;
constexpr double kGoodShare = 0.75;
/// Another reading must be so much better to be named.
constexpr double kClearlyBetter = 0.15;
constexpr std::size_t kManySegments = 6000;
constexpr std::size_t kSomeSegments = 1200;
constexpr std::size_t kTooFewSegments = 60;

/// What the corners say, and with which pieces of their tracks.
struct Evidence {
  SegmentScale scale;
  std::vector<TrackSegment> segments;
  std::vector<TrackSegment> some;  ///< Fewer of them, for what is tried many times.
  std::vector<FramePose> given;
  PoseSupport as_given;
};

std::vector<TrackSegment> Thinned(const std::vector<TrackSegment>& segments, std::size_t most) {
  if (segments.size() <= most) return segments;
  std::vector<TrackSegment> chosen;
  for (std::size_t i = 0; i < most; ++i)
    chosen.push_back(segments[i * segments.size() / most]);
  return chosen;
}

Evidence MakeEvidence(const Dataset& dataset, const TrackedDrive& drive) {
  constexpr std::size_t kViews = 5;
  constexpr std::size_t kFewViews = 3;
  Evidence evidence;
  evidence.scale = JudgingScale(dataset);
  evidence.segments = InformativeSegments(drive.tracks, kViews, evidence.scale, kManySegments);
  if (evidence.segments.size() < kSomeSegments) {
    evidence.segments = InformativeSegments(drive.tracks, kFewViews, evidence.scale, kManySegments);
  }
  evidence.some = Thinned(evidence.segments, kSomeSegments);
  evidence.given = PosesAsGiven(dataset);
  evidence.as_given = MeasureSupport(evidence.segments, evidence.given, evidence.scale);
  return evidence;
}

/// Another reading that fits, and what to call it.
struct Alternative {
  std::string meaning;
  PoseSupport support;
};

/// The first of the readings that fit about best.
Alternative BestReading(const Dataset& dataset, const Evidence& evidence) {
  constexpr double kAsGood = 0.03;
  Alternative best{"", MeasureSupport(evidence.some, evidence.given, evidence.scale)};
  VisitPoseReadings(dataset, [&](const PoseReading& reading) {
    const PoseSupport support = MeasureSupport(evidence.some, reading.poses, evidence.scale);
    if (support.share > best.support.share + kAsGood) best = {reading.meaning, support};
    return true;
  });
  return best;
}

/// Images that are so many rows later or earlier than their poses.
Alternative BestShift(const Dataset& dataset, const Evidence& evidence, double& rows) {
  Alternative best{"", MeasureSupport(evidence.some, evidence.given, evidence.scale)};
  double least_cost = best.support.cost;
  for (const double size : {0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 15.0, 20.0, 30.0}) {
    for (const double offset : {size, -size}) {
      if (size + 2.0 > static_cast<double>(dataset.frames.size())) continue;
      const auto poses = ShiftedPoses(dataset, offset);
      const PoseSupport support = MeasureSupport(evidence.some, poses, evidence.scale);
      if (support.cost >= least_cost) continue;
      least_cost = support.cost;
      rows = offset;
      best = {fmt::format("the images were taken {:g} rows {} their poses",
                          size,
                          offset > 0.0 ? "after" : "before"),
              support};
    }
  }
  return best;
}

/// How the fit changes with the focal length.
struct FocalFit {
  double factor = 1.0;    ///< At the best fit.
  bool is_known = false;  ///< The fit gets worse on both sides.
  PoseSupport support;    ///< At the best fit.
};

FocalFit FitFocal(const Evidence& evidence) {
  constexpr int kSteps = 16;
  constexpr double kStep = 0.05;  // of the logarithm
  constexpr int kAside = 3;       // steps at which the fit must be worse
  constexpr double kWorse = 1.08;
  std::vector<PoseSupport> supports;
  SegmentScale scale = evidence.scale;
  for (int step = -kSteps; step <= kSteps; ++step) {
    scale.focal_factor = std::exp(kStep * step);
    supports.push_back(MeasureSupport(evidence.some, evidence.given, scale));
  }
  const auto best = std::min_element(supports.begin(),
                                     supports.end(),
                                     [](const auto& a, const auto& b) { return a.cost < b.cost; });
  const auto at = best - supports.begin();
  FocalFit fit{.factor = std::exp(kStep * static_cast<double>(at - kSteps)), .support = *best};
  if (at < kAside || at + kAside >= std::ssize(supports)) return fit;
  const auto cost = [&](std::ptrdiff_t offset) {
    return supports[static_cast<std::size_t>(at + offset)].cost;
  };
  fit.is_known = std::min(cost(-kAside), cost(kAside)) > kWorse * cost(0);
  // The lowest point of the parabola through the best and its neighbours.
  const double bend = cost(-1) - 2.0 * cost(0) + cost(1);
  if (bend > 0.0) fit.factor *= std::exp(kStep * 0.5 * (cost(-1) - cost(1)) / bend);
  return fit;
}

std::string Percent(double share) {
  return fmt::format("{:.0f} %", 100.0 * share);
}

/// When the poses do not fit: why, as far as it can be found out.
void ExplainMisfit(const Dataset& dataset,
                   const Evidence& evidence,
                   const FocalFit& focal,
                   InputFindings& findings) {
  const double given = evidence.as_given.share;
  const Alternative reading = BestReading(dataset, evidence);
  double rows = 0.0;
  const Alternative shift = BestShift(dataset, evidence, rows);
  const double best = std::max({reading.support.share, shift.support.share, focal.support.share});
  const std::string fits =
      fmt::format("{} of the corners followed through the images fit the poses", Percent(given));
  if (best < given + kClearlyBetter) {
    findings.Refuse(
        "poses",
        fmt::format("{}, must be at least {}, and no other reading of them fits better: "
                    "are the rows of poses_tum.txt those of the images of frames.txt "
                    "(first {}), and is intrinsics.txt this camera's?",
                    fits,
                    Percent(kLeastShare),
                    NameFrame(dataset, 0)));
  } else if (reading.support.share == best) {
    findings.Refuse("poses",
                    fmt::format("{}, {} if {}: write poses_tum.txt as camera to world, with the "
                                "camera's x right, y down, z forward and qx qy qz qw",
                                fits,
                                Percent(best),
                                reading.meaning));
  } else if (shift.support.share == best) {
    findings.Refuse("time",
                    fmt::format("{}, {} if {}: put each pose beside the image of its time",
                                fits,
                                Percent(best),
                                shift.meaning));
  } else {
    findings.Refuse("focal",
                    fmt::format("{}, {} with {:.2f} times the focal length ({:.1f} px in "
                                "intrinsics.txt): calibrate the camera at the images' size",
                                fits,
                                Percent(best),
                                focal.factor,
                                dataset.intrinsics.fx));
  }
}

/// When the poses fit, but something fits better.
void LookForOffsets(const Dataset& dataset,
                    const Evidence& evidence,
                    const FocalFit& focal,
                    InputFindings& findings) {
  constexpr double kFocalOff = 0.04;  // of the logarithm
  constexpr double kFocalWrong = 0.15;
  constexpr double kLessCost = 0.8;
  double rows = 0.0;
  const Alternative shift = BestShift(dataset, evidence, rows);
  const PoseSupport given = MeasureSupport(evidence.some, evidence.given, evidence.scale);
  if (shift.support.cost < kLessCost * given.cost && shift.support.share > given.share) {
    findings.Warn("time",
                  fmt::format("the corners fit better if {} ({} instead of {}): check the times of "
                              "images and poses",
                              shift.meaning,
                              Percent(shift.support.share),
                              Percent(given.share)));
    return;
  }
  const double off = std::abs(std::log(focal.factor));
  if (!focal.is_known || off < kFocalOff || focal.support.cost > kLessCost * given.cost) return;
  const std::string message = fmt::format(
      "the corners fit best with {:.2f} times the focal length ({:.1f} px in intrinsics.txt): "
      "calibrate the camera at the images' size",
      focal.factor,
      dataset.intrinsics.fx);
  if (off > kFocalWrong) {
    findings.Refuse("focal", message);
  } else {
    findings.Warn("focal", message);
  }
}

/// Single poses that the images around them contradict.
void FindWrongFrames(const Dataset& dataset,
                     const TrackedDrive& drive,
                     const Evidence& evidence,
                     InputFindings& findings) {
  constexpr std::size_t kViews = 3;
  constexpr int kLeastTracks = 12;
  constexpr double kLeastOfFrame = 0.3;
  constexpr double kMoreTolerance = 2.0;  // a pose is wrong, not a little inexact
  constexpr double kMany = 0.25;
  std::vector<int> tracks(dataset.frames.size());
  std::vector<int> fitting(dataset.frames.size());
  SegmentScale scale = evidence.scale;
  scale.tolerance_px *= kMoreTolerance;
  for (const TrackSegment& segment :
       InformativeSegments(drive.tracks, kViews, scale, std::numeric_limits<std::size_t>::max())) {
    const std::uint32_t middle = segment[1].frame;
    ++tracks[middle];
    const double error_px = FitSegment(segment, evidence.given, scale).error_px;
    if (error_px < scale.tolerance_px) ++fitting[middle];
  }
  std::vector<std::size_t> wrong;
  for (std::size_t frame = 0; frame < tracks.size(); ++frame) {
    if (tracks[frame] >= kLeastTracks && fitting[frame] < kLeastOfFrame * tracks[frame]) {
      wrong.push_back(frame);
    }
  }
  if (wrong.empty()) return;
  const std::string message = fmt::format(
      "{} of {} poses contradict their images ({}): they jump, or belong to other "
      "images; mend them, or take their rows out",
      wrong.size(),
      dataset.frames.size(),
      NameFrames(dataset, wrong));
  if (static_cast<double>(wrong.size()) > kMany * static_cast<double>(tracks.size())) {
    findings.Refuse("poses", message);
  } else {
    findings.Warn("poses", message);
  }
}

/// How high cameras are above what they see below the horizon, and how far things are.
void MeasureScene(const Evidence& evidence, InputSummary& summary) {
  constexpr double kBelowHorizonRad = 0.12;
  constexpr std::size_t kEnough = 50;
  Eigen::Vector3d up_W = Eigen::Vector3d::Zero();
  for (const FramePose& pose : evidence.given)
    up_W -= pose.R_WC.col(1);
  up_W.normalize();
  std::vector<double> parallaxes_deg;
  std::vector<double> depths_m;
  std::vector<double> heights_m;
  for (const TrackSegment& segment : evidence.segments) {
    const SegmentFit fit = FitSegment(segment, evidence.given, evidence.scale);
    if (fit.error_px > evidence.scale.tolerance_px) continue;
    parallaxes_deg.push_back(kDegrees * std::atan(fit.parallax_px / evidence.scale.focal_px));
    if (fit.parallax_px < 2.0 * evidence.scale.tolerance_px) continue;
    depths_m.push_back(1.0 / fit.inverse_depth);
    const Eigen::Vector3d ray_C = segment.front().ray.cast<double>().homogeneous();
    const Eigen::Vector3d ray_W = evidence.given[segment.front().frame].R_WC * ray_C;
    const double below = -up_W.dot(ray_W);
    if (below > kBelowHorizonRad * ray_W.norm()) heights_m.push_back(below / fit.inverse_depth);
  }
  summary.parallax_deg = MedianOf(parallaxes_deg);
  summary.depth_m = MedianOf(depths_m);
  if (heights_m.size() >= kEnough) summary.camera_height_m = MedianOf(heights_m);
}

void CheckParallax(const Dataset& dataset, const InputSummary& summary, InputFindings& findings) {
  constexpr double kNoneDeg = 0.15;
  constexpr double kLittleDeg = 0.4;
  if (summary.parallax_deg >= kLittleDeg) return;
  const std::string message = fmt::format(
      "things move by {:.2f} deg against each other over a few images (from {} on), should be at "
      "least {} deg: depths cannot be measured; drive, do not only turn, and pass things nearby",
      summary.parallax_deg,
      NameFrame(dataset, 0),
      kLittleDeg);
  if (summary.parallax_deg < kNoneDeg) {
    findings.Refuse("parallax", message);
  } else {
    findings.Warn("parallax", message);
  }
}

void CheckScale(const InputSummary& summary, InputFindings& findings) {
  constexpr double kLowM = 0.05;
  constexpr double kHighM = 6.0;
  constexpr double kNearM = 0.3;
  constexpr double kFarM = 150.0;
  if (summary.camera_height_m &&
      (*summary.camera_height_m < kLowM || *summary.camera_height_m > kHighM)) {
    findings.Warn(
        "scale",
        fmt::format("by the poses the ground is {:.3g} m below the camera, expected {} to "
                    "{} m: are the positions in metres?",
                    *summary.camera_height_m,
                    kLowM,
                    kHighM));
  } else if (summary.depth_m > 0.0 && (summary.depth_m < kNearM || summary.depth_m > kFarM)) {
    findings.Warn("scale",
                  fmt::format("by the poses things are {:.3g} m away in the median, expected {} to "
                              "{} m: are the positions in metres?",
                              summary.depth_m,
                              kNearM,
                              kFarM));
  }
}

}  // namespace

SegmentScale JudgingScale(const Dataset& dataset) {
  constexpr double kToleranceRad = 0.003;
  return {.focal_px = dataset.intrinsics.fx,
          .tolerance_px = std::max(1.0, kToleranceRad * dataset.intrinsics.fx)};
}

void CheckPoses(const Dataset& dataset,
                const TrackedDrive& drive,
                InputSummary& summary,
                InputFindings& findings) {
  const Evidence evidence = MakeEvidence(dataset, drive);
  summary.tolerance_px = evidence.scale.tolerance_px;
  if (evidence.segments.size() < kTooFewSegments) {
    findings.Warn("poses",
                  fmt::format("{} corners could be followed through {} images, must be {} to check "
                              "the poses: are the images of one drive and in order (first {})?",
                              evidence.segments.size(),
                              drive.images_looked_at,
                              kTooFewSegments,
                              NameFrame(dataset, 0)));
    return;
  }
  summary.segments = evidence.segments.size();
  summary.fitting_share = evidence.as_given.share;
  const FocalFit focal = FitFocal(evidence);
  if (evidence.as_given.share < kLeastShare) {
    ExplainMisfit(dataset, evidence, focal, findings);
    return;
  }
  if (focal.is_known) summary.focal_factor = focal.factor;
  MeasureScene(evidence, summary);
  LookForOffsets(dataset, evidence, focal, findings);
  FindWrongFrames(dataset, drive, evidence, findings);
  CheckParallax(dataset, summary, findings);
  CheckScale(summary, findings);
  CheckDepthImages(dataset, drive, summary, findings);
}

}  // namespace relocd
