#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "camera/dataset.h"
#include "core/result.h"

namespace relocd {

/// Which frames of a data set a command works on.
struct FrameSelection {
  std::string dataset;  ///< Folder.
  std::string split;    ///< File; empty for all frames.
  std::string frames;   ///< `A:B` of frame indices; empty for all.
};

/// A data set of which only some frames are left.
struct SelectedFrames {
  Dataset dataset;
  std::string name;  ///< Of the data set's folder.
};

/// Reads a data set and keeps the frames in the range and, if there is a split, of that part.
///
/// @return kInvalidInput when none is left, or as ReadDataset and ReadSplit.
Result<SelectedFrames> SelectFrames(const FrameSelection& selection, SplitPart part);

/// The data set's world in the map's frame, whose z is up: chosen by the axis that is up for the
/// cameras, on average.
///
/// @return kInvalidInput, naming the axis, when it is none of +z, +y and -y.
Result<Eigen::Quaterniond> RotationToMap(const Dataset& dataset);

}  // namespace relocd
