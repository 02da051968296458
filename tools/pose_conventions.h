#pragma once

#include <functional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "camera/dataset.h"
#include "track_geometry.h"

namespace relocd {

/// Another reading of a data set's poses, by which they may be meant.
struct PoseReading {
  std::string meaning;  ///< What the poses are then: `the poses are world to camera`.
  std::vector<FramePose> poses;
};

/// The poses as they are in the file.
std::vector<FramePose> PosesAsGiven(const Dataset& dataset);

/// All readings that are tried, from usual mistakes to rare ones, one after the other:
///
/// - world to camera, or only the rotation so; quaternions that begin with qw; rows from last to
///   first;
/// - of each of these, every way to lay the camera's axes, also left-handed ones: mirrored images
///   and mirrored worlds among them;
/// - positions with their axes swapped or mirrored, beside rotations that are right.
///
/// `visit` gets each and says whether it wants more.
void VisitPoseReadings(const Dataset& dataset,
                       const std::function<bool(const PoseReading&)>& visit);

/// The poses of the frames `offset` rows later; between rows, in proportion. Beyond the ends the
/// last pose stays.
std::vector<FramePose> ShiftedPoses(const Dataset& dataset, double offset);

}  // namespace relocd
