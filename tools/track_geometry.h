#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "corner_tracks.h"

namespace relocd {

/// A camera's pose in the form that loops over many corners use.
struct FramePose {
  Eigen::Matrix3d R_WC = Eigen::Matrix3d::Identity();
  Eigen::Vector3d p_WC = Eigen::Vector3d::Zero();
};

/// A few views of one corner. Borrows them.
using TrackSegment = std::span<const CornerView>;

/// In which numbers a segment is judged.
struct SegmentScale {
  double focal_px = 0.0;
  double tolerance_px = 0.0;  ///< Corners are followed, and poses known, about so exactly.
  double focal_factor = 1.0;  ///< The focal length is tried as this many times what it was given.
};

/// What a segment says of the poses.
struct SegmentFit {
  double error_px = 0.0;       ///< RMS reprojection error at the best depth.
  double inverse_depth = 0.0;  ///< In the first view, in 1/m.
  double parallax_px = 0.0;    ///< How far the depth moves the corner.
};

/// The depth >= 0 along the first view's ray at which all views see the corner best.
SegmentFit FitSegment(TrackSegment segment,
                      std::span<const FramePose> poses,
                      const SegmentScale& scale);

/// How far a corner moves between the first and the last view, in px.
double MotionPx(TrackSegment segment, double focal_px);

/// How well segments fit poses.
struct PoseSupport {
  std::size_t segments = 0;
  double share = 0.0;  ///< Of segments within the tolerance.
  double cost = 0.0;   ///< Mean of the squared errors, each at most 1: 0 is a perfect fit.
};

PoseSupport MeasureSupport(std::span<const TrackSegment> segments,
                           std::span<const FramePose> poses,
                           const SegmentScale& scale);

/// Segments of `views` views that move enough to tell something, at most `most`, evenly chosen.
std::vector<TrackSegment> InformativeSegments(const std::vector<CornerTrack>& tracks,
                                              std::size_t views,
                                              const SegmentScale& scale,
                                              std::size_t most);

}  // namespace relocd
