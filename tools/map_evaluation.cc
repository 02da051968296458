#include "map_evaluation.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <functional>
#include <memory>
#include <numbers>
#include <numeric>
#include <optional>
#include <thread>
#include <utility>

#include <fmt/format.h>

#include "camera/jpeg.h"
#include "core/file.h"
#include "geometry/covariance.h"
#include "relocalization/map_localizer.h"

namespace relocd {
namespace {

Pose3 TruthInMap(const SceneMap& map, const DatasetFrame& frame) {
  return Pose3(map.R_WD, Eigen::Vector3d::Zero()) * frame.X_WC;
}

using ImageChange = std::function<GrayImage(const GrayImage& image, int index)>;

Result<FrameLocalization> LocalizeFrame(MapLocalizer& localizer,
                                        const DatasetFrame& frame,
                                        const ImageChange& change) {
  const auto bytes = ReadFile(frame.image_path);
  if (!bytes) return bytes.error();
  auto start = std::chrono::steady_clock::now();
  auto image = DecodeJpegToGray(AsBytes(*bytes));
  if (!image) return Error(image.error()).WithContext(frame.image_path);
  if (change) {
    *image = change(*image, frame.index);
    start = std::chrono::steady_clock::now();
  }
  const auto seed = static_cast<std::uint64_t>(frame.index);
  const auto localization = localizer.LocalizeAnywhere(*image, seed);
  if (!localization) return Error(localization.error()).WithContext(frame.image_path);
  const auto elapsed = std::chrono::steady_clock::now() - start;
  return FrameLocalization{
      .frame = frame,
      .pose = localization->pose,
      .region = static_cast<std::size_t>(std::max(0, localization->region)),
      .milliseconds = std::chrono::duration<double, std::milli>(elapsed).count()};
}

/// One thread's part: works on the next frame until none is left.
Result<void> LocalizeSome(const SceneMap& map,
                          const std::vector<DatasetFrame>& frames,
                          const ImageChange& change,
                          std::atomic<std::size_t>& next,
                          std::vector<FrameLocalization>& results) {
  auto localizer = MapLocalizer::Create(map, {});
  if (!localizer) return std::move(localizer).error();
  for (std::size_t index = next++; index < frames.size(); index = next++) {
    auto result = LocalizeFrame(**localizer, frames[index], change);
    if (!result) return std::move(result).error();
    results[index] = std::move(*result);
  }
  return {};
}

}  // namespace

Result<std::vector<FrameLocalization>> LocalizeFrames(const SceneMap& map,
                                                      const std::vector<DatasetFrame>& frames,
                                                      int threads,
                                                      const ImageChange& change) {
  std::vector<FrameLocalization> results(frames.size());
  std::vector<Result<void>> ends(static_cast<std::size_t>(threads));
  std::atomic<std::size_t> next = 0;
  const auto work = [&](Result<void>& end) {
    end = LocalizeSome(map, frames, change, next, results);
  };
  {
    std::vector<std::jthread> others;
    for (std::size_t thread = 1; thread < ends.size(); ++thread) {
      others.emplace_back(work, std::ref(ends[thread]));
    }
    work(ends.front());
  }
  for (Result<void>& end : ends) {
    if (!end) return std::move(end).error();
  }
  return results;
}

Vector6d PoseError(const SceneMap& map, const FrameLocalization& localization) {
  return (localization.pose.X_WC.Inverse() * TruthInMap(map, localization.frame)).Log();
}

double Quantile(std::vector<double> values, double share) {
  const auto last = static_cast<double>(values.size() - 1);
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(std::lround(share * last));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

namespace {

/// The place of each value among all, from 0.
std::vector<double> Ranks(const std::vector<double>& values) {
  std::vector<std::size_t> order(values.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::sort(order, {}, [&values](std::size_t index) { return values[index]; });
  std::vector<double> ranks(values.size());
  for (std::size_t rank = 0; rank < order.size(); ++rank) {
    ranks[order[rank]] = static_cast<double>(rank);
  }
  return ranks;
}

/// Spearman's; equal values have neighbouring ranks, which is right enough for real numbers.
double RankCorrelation(const std::vector<double>& a, const std::vector<double>& b) {
  const auto n = static_cast<double>(a.size());
  if (a.size() < 3) return 0.0;
  const std::vector<double> ranks_a = Ranks(a);
  const std::vector<double> ranks_b = Ranks(b);
  double squares = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    squares += (ranks_a[i] - ranks_b[i]) * (ranks_a[i] - ranks_b[i]);
  }
  return 1.0 - 6.0 * squares / (n * (n * n - 1.0));
}

}  // namespace

PoseErrors MeasureErrors(const SceneMap& map, const std::vector<FrameLocalization>& localizations) {
  PoseErrors errors;
  errors.frames = localizations.size();
  std::vector<double> metres;
  std::vector<double> sigmas_m;
  std::vector<double> radians;
  std::vector<double> milliseconds;
  std::size_t near = 0;
  std::size_t inside = 0;
  for (const FrameLocalization& localization : localizations) {
    milliseconds.push_back(localization.milliseconds);
    if (localization.pose.status != CameraPoseStatus::kOk) continue;
    const Pose3 truth = TruthInMap(map, localization.frame);
    const Pose3& X_WC = localization.pose.X_WC;
    metres.push_back((X_WC.translation() - truth.translation()).norm());
    radians.push_back(AngleBetween(X_WC.rotation(), truth.rotation()));
    const Matrix6d& covariance = localization.pose.covariance;
    sigmas_m.push_back(std::sqrt(covariance.topLeftCorner<3, 3>().trace()));
    if (metres.back() < 1.0) ++near;
    if (metres.back() > 10.0) ++errors.wrong_10m;
    const double distance =
        SquaredMahalanobis(PoseError(map, localization), localization.pose.covariance);
    if (distance < kChiSquared95Dof6) ++inside;
  }
  errors.localized = metres.size();
  if (!milliseconds.empty()) {
    errors.median_ms = Quantile(milliseconds, 0.5);
    errors.p99_ms = Quantile(milliseconds, 0.99);
  }
  if (metres.empty()) return errors;
  errors.sigma_rank_correlation = RankCorrelation(sigmas_m, metres);
  errors.median_m = Quantile(metres, 0.5);
  errors.p95_m = Quantile(metres, 0.95);
  errors.median_rad = Quantile(radians, 0.5);
  errors.within_1m = static_cast<double>(near) / static_cast<double>(errors.frames);
  errors.within_95 = static_cast<double>(inside) / static_cast<double>(errors.localized);
  return errors;
}

std::string FormatAccuracy(const PoseErrors& errors) {
  if (errors.localized == 0) return "none found";
  constexpr double kDegrees = 180.0 / std::numbers::pi;
  return fmt::format(
      "median {:.3f} m, {:.3f} deg; p95 {:.3f} m; within 1 m {:.1f} %; inside the reported 95 % "
      "region {:.0f} %",
      errors.median_m,
      errors.median_rad * kDegrees,
      errors.p95_m,
      100.0 * errors.within_1m,
      100.0 * errors.within_95);
}

}  // namespace relocd
