#include "pose_conventions.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "geometry/pose3.h"

namespace relocd {
namespace {

/// The 48 ways to lay three axes along three others, rotations first.
std::vector<Eigen::Matrix3d> SignedPermutations() {
  std::vector<Eigen::Matrix3d> rotations;
  std::vector<Eigen::Matrix3d> mirrors;
  std::array<int, 3> order = {0, 1, 2};
  do {
    for (unsigned signs = 0; signs < 8; ++signs) {
      Eigen::Matrix3d matrix = Eigen::Matrix3d::Zero();
      for (int row = 0; row < 3; ++row) {
        const bool is_negative = (signs >> static_cast<unsigned>(row) & 1U) != 0;
        matrix(row, order[static_cast<std::size_t>(row)]) = is_negative ? -1.0 : 1.0;
      }
      (matrix.determinant() > 0.0 ? rotations : mirrors).push_back(matrix);
    }
  } while (std::next_permutation(order.begin(), order.end()));
  rotations.insert(rotations.end(), mirrors.begin(), mirrors.end());
  return rotations;
}

/// The one axis that a row or column of a signed permutation points along, and which way.
std::pair<std::size_t, bool> AxisOf(const Eigen::Vector3d& direction) {
  Eigen::Index axis = 0;
  direction.cwiseAbs().maxCoeff(&axis);
  return {static_cast<std::size_t>(axis), direction[axis] < 0.0};
}

/// `x forward, y left, z up`: where the file's camera axes point.
std::string DescribeCameraAxes(const Eigen::Matrix3d& axes) {
  constexpr std::array<std::array<std::string_view, 2>, 3> kWords = {
      {{"right", "left"}, {"down", "up"}, {"forward", "back"}}};
  std::string text;
  for (int row = 0; row < 3; ++row) {
    const auto [axis, is_negative] = AxisOf(axes.row(row).transpose());
    text += fmt::format("{}{} {}", row == 0 ? "" : ", ", "xyz"[row], kWords[axis][is_negative]);
  }
  return text;
}

/// `(x, -z, y)`: what positions fit as.
std::string DescribePositions(const Eigen::Matrix3d& axes) {
  std::string text;
  for (int row = 0; row < 3; ++row) {
    const auto [axis, is_negative] = AxisOf(axes.row(row).transpose());
    text += fmt::format("{}{}{}", row == 0 ? "(" : ", ", is_negative ? "-" : "", "xyz"[axis]);
  }
  return text + ")";
}

/// How the rows of the file are to be understood.
struct RowReading {
  std::string meaning;
  std::vector<FramePose> poses;
};

FramePose Inverted(const FramePose& pose) {
  return {pose.R_WC.transpose(), -(pose.R_WC.transpose() * pose.p_WC)};
}

std::vector<FramePose> Transformed(const std::vector<FramePose>& poses,
                                   FramePose (*transform)(const FramePose&)) {
  std::vector<FramePose> transformed(poses.size());
  std::transform(poses.begin(), poses.end(), transformed.begin(), transform);
  return transformed;
}

std::vector<RowReading> RowReadings(const Dataset& dataset) {
  const std::vector<FramePose> given = PosesAsGiven(dataset);
  std::vector<FramePose> scalar_first;
  for (const DatasetFrame& frame : dataset.frames) {
    const Eigen::Quaterniond& q = frame.X_WC.rotation();
    scalar_first.push_back({Eigen::Quaterniond(q.x(), q.y(), q.z(), q.w()).toRotationMatrix(),
                            frame.X_WC.translation()});
  }
  std::vector<RowReading> readings = {
      {"", given},
      {"the poses are world to camera", Transformed(given, Inverted)},
      {"the quaternions begin with qw", scalar_first},
      {"the poses are world to camera and their quaternions begin with qw",
       Transformed(scalar_first, Inverted)},
      {"the rotations are world to camera, the positions are not",
       Transformed(given,
                   [](const FramePose& pose) {
                     return FramePose{pose.R_WC.transpose(), pose.p_WC};
                   })},
      {"the rows are in the order from last to first", {given.rbegin(), given.rend()}}};
  return readings;
}

/// The reading with its camera axes laid along `axes`, an orthogonal matrix.
PoseReading WithCameraAxes(const RowReading& row, const Eigen::Matrix3d& axes) {
  const bool is_mirror = axes.determinant() < 0.0;
  const Eigen::Matrix3d rotation = is_mirror ? Eigen::Matrix3d(-axes) : axes;
  std::string meaning = row.meaning;
  if (!axes.isIdentity()) {
    const std::string described = DescribeCameraAxes(axes);
    if (!meaning.empty()) meaning += ", and ";
    meaning += is_mirror ? fmt::format(
                               "the images or the world are mirrored (the camera's axes fit as {})",
                               described)
                         : fmt::format("the camera's axes are {}", described);
  }
  PoseReading reading{std::move(meaning), row.poses};
  for (FramePose& pose : reading.poses) {
    pose.R_WC = pose.R_WC * rotation;
    if (is_mirror) pose.p_WC = -pose.p_WC;
  }
  return reading;
}

}  // namespace

std::vector<FramePose> PosesAsGiven(const Dataset& dataset) {
  std::vector<FramePose> poses;
  for (const DatasetFrame& frame : dataset.frames)
    poses.push_back({frame.X_WC.R(), frame.X_WC.translation()});
  return poses;
}

void VisitPoseReadings(const Dataset& dataset,
                       const std::function<bool(const PoseReading&)>& visit) {
  const std::vector<Eigen::Matrix3d> all_axes = SignedPermutations();
  const std::vector<RowReading> rows = RowReadings(dataset);
  for (const Eigen::Matrix3d& axes : all_axes) {
    for (const RowReading& row : rows) {
      if (row.meaning.empty() && axes.isIdentity()) continue;
      if (!visit(WithCameraAxes(row, axes))) return;
    }
  }
  for (const Eigen::Matrix3d& axes : all_axes) {
    if (axes.isIdentity()) continue;
    PoseReading reading{fmt::format("the positions fit as {} beside rotations as they are",
                                    DescribePositions(axes)),
                        rows.front().poses};
    for (FramePose& pose : reading.poses)
      pose.p_WC = axes * pose.p_WC;
    if (!visit(reading)) return;
  }
}

std::vector<FramePose> ShiftedPoses(const Dataset& dataset, double offset) {
  const auto last = static_cast<double>(dataset.frames.size() - 1);
  std::vector<FramePose> poses;
  for (std::size_t i = 0; i < dataset.frames.size(); ++i) {
    const double at = std::clamp(static_cast<double>(i) + offset, 0.0, last);
    const auto before = static_cast<std::size_t>(std::floor(at));
    const auto after = static_cast<std::size_t>(std::ceil(at));
    const double share = at - std::floor(at);
    const Pose3& a = dataset.frames[before].X_WC;
    const Pose3& b = dataset.frames[after].X_WC;
    poses.push_back({a.rotation().slerp(share, b.rotation()).toRotationMatrix(),
                     (1.0 - share) * a.translation() + share * b.translation()});
  }
  return poses;
}

}  // namespace relocd
