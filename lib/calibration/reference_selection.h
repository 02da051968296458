#pragma once

#include <vector>

#include "calibration/drive_filter.h"
#include "calibration/odometry_recording.h"

namespace relocd {

/// The poses of a reference that a calibration works with.
struct ReferenceSelection {
  std::vector<ReferencePose> poses{};
  int disagreeing = 0;  ///< Left out.
};

/// Poses `spacing_s` apart and the last one, within the recording's time, of which at least half of
/// the neighbours are as far away as odometry has it. One that is far off would draw a filter with
/// it, or be where it begins; what passes here and is still off counts less there.
ReferenceSelection SelectReferences(const OdometryRecording& recording,
                                    const std::vector<ReferencePose>& references,
                                    double spacing_s);

}  // namespace relocd
