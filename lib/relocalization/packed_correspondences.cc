#include "relocalization/packed_correspondences.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "core/counter_random.h"

namespace relocd {
namespace {

/// Coordinates beyond this are no place on a map, and their squares would not fit a float.
constexpr double kMaxCoordinate = 1e8;

/// Draws that no sampling uses: its counters start from zero.
constexpr std::uint64_t kShuffleCounters = std::uint64_t{1} << 62;

bool IsUsable(const Correspondence& correspondence) {
  return correspondence.pixel.allFinite() && correspondence.p_WP.allFinite() &&
         std::isfinite(correspondence.confidence) &&
         correspondence.p_WP.cwiseAbs().maxCoeff() < kMaxCoordinate;
}

/// The median of each coordinate, which outliers do not move far.
Eigen::Vector3d Middle(std::span<const Correspondence> correspondences,
                       const std::vector<std::uint32_t>& usable) {
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  if (usable.empty()) return middle;
  std::vector<double> values(usable.size());
  const auto median = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    std::ranges::transform(
        usable, values.begin(), [&](std::uint32_t i) { return correspondences[i].p_WP[axis]; });
    std::ranges::nth_element(values, median);
    middle[axis] = *median;
  }
  return middle;
}

/// The indices of what is at least as large as the middle; of few, all.
std::vector<std::uint32_t> UpperHalf(const std::vector<float>& values) {
  constexpr std::size_t kFew = 50;
  float middle = -std::numeric_limits<float>::infinity();
  if (values.size() > kFew) {
    std::vector<float> sorted = values;
    const auto at = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
    std::ranges::nth_element(sorted, at);
    middle = *at;
  }
  std::vector<std::uint32_t> upper;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (values[i] >= middle) upper.push_back(static_cast<std::uint32_t>(i));
  }
  return upper;
}

}  // namespace

PackedCorrespondences::PackedCorrespondences(std::span<const Correspondence> correspondences,
                                             const PinholeCamera& camera,
                                             std::uint64_t seed)
    : focal_(camera.intrinsics().fx, camera.intrinsics().fy) {
  std::vector<std::uint32_t> order;
  order.reserve(correspondences.size());
  for (std::size_t i = 0; i < correspondences.size(); ++i) {
    if (IsUsable(correspondences[i])) order.push_back(static_cast<std::uint32_t>(i));
  }
  p_WM_ = Middle(correspondences, order);

  const CounterRandom random(seed);
  for (std::size_t i = order.size(); i > 1; --i) {
    const auto bits = static_cast<std::uint32_t>(random.Bits(kShuffleCounters + i));
    std::swap(order[i - 1], order[CounterRandom::Below(static_cast<std::uint32_t>(i), bits)]);
  }

  stride_ = (order.size() + kLanes - 1) / kLanes * kLanes;
  data_.assign(5 * stride_, 0.0F);
  float* const columns[5] = {data_.data(),
                             data_.data() + stride_,
                             data_.data() + 2 * stride_,
                             data_.data() + 3 * stride_,
                             data_.data() + 4 * stride_};
  std::vector<float> confidences;
  confidences.reserve(order.size());
  for (const std::uint32_t i : order) {
    const std::optional<Eigen::Vector2d> ray = camera.Unproject(correspondences[i].pixel);
    if (!ray) continue;
    const Eigen::Vector3f p_MP = (correspondences[i].p_WP - p_WM_).cast<float>();
    for (Eigen::Index axis = 0; axis < 3; ++axis)
      columns[axis][size_] = p_MP[axis];
    columns[3][size_] = static_cast<float>(ray->x() * focal_.x());
    columns[4][size_] = static_cast<float>(ray->y() * focal_.y());
    confidences.push_back(correspondences[i].confidence);
    ++size_;
  }
  likely_ = UpperHalf(confidences);
  // So far from every projection that the square of the squared error is infinite, and the score 0.
  constexpr float kNowhere = 1e12F;
  std::fill(columns[3] + size_, columns[3] + stride_, kNowhere);
}

std::size_t PackedCorrespondences::PaddedSize(std::size_t count) const {
  return (std::min(count, size_) + kLanes - 1) / kLanes * kLanes;
}

}  // namespace relocd
