#include "map_dataset.h"

#include <array>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <map>
#include <utility>

#include <Eigen/Core>
#include <fmt/core.h>

#include "core/index_range.h"

namespace relocd {
namespace {

Error Invalid(std::string message) {
  return {ErrorKind::kInvalidInput, std::move(message)};
}

Result<void> KeepRange(const std::string& range_text, Dataset& dataset) {
  const auto range = ParseIndexRange(range_text, dataset.frames.size());
  if (!range) return Error(range.error()).WithContext("--frames");
  std::erase_if(dataset.frames, [&](const DatasetFrame& frame) {
    return !range->Contains(static_cast<std::size_t>(frame.index));
  });
  return {};
}

Result<void> KeepPart(const std::string& path, SplitPart part, Dataset& dataset) {
  const auto split = ReadSplit(path);
  if (!split) return split.error();
  std::erase_if(dataset.frames, [&](const DatasetFrame& frame) {
    const auto found = split->find(frame.index);
    return found == split->end() || found->second != part;
  });
  return {};
}

std::string AxisName(const Eigen::Vector3d& direction) {
  Eigen::Index axis = 0;
  direction.cwiseAbs().maxCoeff(&axis);
  constexpr std::array<char, 3> kNames = {'x', 'y', 'z'};
  return fmt::format(
      "{}{}", direction[axis] < 0.0 ? '-' : '+', kNames[static_cast<std::size_t>(axis)]);
}

}  // namespace

Result<SelectedFrames> SelectFrames(const FrameSelection& selection, SplitPart part) {
  auto dataset = ReadDataset(selection.dataset);
  if (!dataset) return std::move(dataset).error();
  if (auto kept = KeepRange(selection.frames, *dataset); !kept) return std::move(kept).error();
  if (!selection.split.empty()) {
    if (auto kept = KeepPart(selection.split, part, *dataset); !kept)
      return std::move(kept).error();
  }
  if (dataset->frames.empty()) {
    return Invalid(fmt::format("{}: no frame of --frames '{}' is in the {} part of --split '{}'",
                               selection.dataset,
                               selection.frames,
                               part == SplitPart::kTrain ? "train" : "test",
                               selection.split));
  }
  const auto folder = std::filesystem::absolute(selection.dataset).lexically_normal();
  return SelectedFrames{std::move(*dataset),
                        folder.has_filename() ? folder.filename().string()
                                              : folder.parent_path().filename().string()};
}

Result<Eigen::Quaterniond> RotationToMap(const Dataset& dataset) {
  constexpr double kLeastAgreement = 0.8;  // cameras may look up or down, but not most of the time
  Eigen::Vector3d up_D = Eigen::Vector3d::Zero();
  for (const DatasetFrame& frame : dataset.frames) {
    up_D -= frame.X_WC.R().col(1) / static_cast<double>(dataset.frames.size());
  }
  Eigen::Matrix3d R_WD = Eigen::Matrix3d::Identity();
  const std::string axis = AxisName(up_D);
  if (axis == "-y") {
    R_WD << 0.0, 0.0, 1.0, -1.0, 0.0, 0.0, 0.0, -1.0, 0.0;
  } else if (axis == "+y") {
    R_WD << 0.0, 0.0, -1.0, -1.0, 0.0, 0.0, 0.0, 1.0, 0.0;
  } else if (axis != "+z") {
    return Invalid(fmt::format(
        "{}: the cameras' mean up axis is {} of the data set's world, must be +z, +y or -y",
        dataset.directory,
        axis));
  }
  if (up_D.cwiseAbs().maxCoeff() < kLeastAgreement) {
    return Invalid(fmt::format(
        "{}: the cameras' mean up axis is ({:.2f}, {:.2f}, {:.2f}) in the data set's world, must "
        "be "
        "near +z, +y or -y: are the poses camera to world, with x right, y down, z forward?",
        dataset.directory,
        up_D.x(),
        up_D.y(),
        up_D.z()));
  }
  return Eigen::Quaterniond(R_WD);
}

}  // namespace relocd
