#include "map_route.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <fmt/format.h>

namespace relocd {
namespace {

/// A drive may be this far from the first one's route.
constexpr double kMaxAsideM = 15.0;
/// How far from a place a camera may be, to be as unlike it as one that looks 1 rad aside.
constexpr double kMetresPerRadian = 10.0;

Error Invalid(std::string message) {
  return {ErrorKind::kInvalidInput, std::move(message)};
}

std::vector<double> TravelledMetres(const std::vector<DatasetFrame>& frames) {
  std::vector<double> travelled = {0.0};
  for (std::size_t index = 1; index < frames.size(); ++index) {
    const Eigen::Vector3d step =
        frames[index].X_WC.translation() - frames[index - 1].X_WC.translation();
    travelled.push_back(travelled.back() + step.norm());
  }
  return travelled;
}

/// The frame of `drive` whose camera stood and looked most alike.
std::size_t NearestFrame(const std::vector<DatasetFrame>& drive, const Pose3& X_WC) {
  std::size_t nearest = 0;
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t index = 0; index < drive.size(); ++index) {
    const Pose3& other = drive[index].X_WC;
    const double unlike = (other.translation() - X_WC.translation()).norm() +
                          kMetresPerRadian * AngleBetween(other.rotation(), X_WC.rotation());
    if (unlike < least) {
      least = unlike;
      nearest = index;
    }
  }
  return nearest;
}

Result<void> CheckAlike(const SelectedFrames& first, const SelectedFrames& other) {
  if (!(other.dataset.intrinsics == first.dataset.intrinsics)) {
    return Invalid(
        fmt::format("{}: its intrinsics.txt is another than that of {}; drives of one map "
                    "must have one camera",
                    other.dataset.directory,
                    first.dataset.directory));
  }
  const auto R_WD = RotationToMap(first.dataset);
  if (!R_WD) return R_WD.error();
  const auto other_R_WD = RotationToMap(other.dataset);
  if (!other_R_WD) return other_R_WD.error();
  constexpr double kSame = 1e-6;
  if (AngleBetween(*R_WD, *other_R_WD) > kSame) {
    return Invalid(
        fmt::format("{}: its world has another axis up than that of {}; drives of one map "
                    "must have one world",
                    other.dataset.directory,
                    first.dataset.directory));
  }
  return {};
}

/// The drives' first one, and how far along it each of its frames was taken.
struct Route {
  const SelectedFrames& drive;
  std::vector<double> travelled_m;
};

Result<RouteFrame> PlaceFrame(const Route& route, const DatasetFrame& frame) {
  const std::vector<DatasetFrame>& frames = route.drive.dataset.frames;
  const std::size_t at = NearestFrame(frames, frame.X_WC);
  const double aside_m = (frames[at].X_WC.translation() - frame.X_WC.translation()).norm();
  if (aside_m > kMaxAsideM) {
    return Invalid(fmt::format("frame {} is {:.1f} m from the route of {}, must be within {} m",
                               frame.index,
                               aside_m,
                               route.drive.dataset.directory,
                               kMaxAsideM));
  }
  return RouteFrame{.frame = frame, .along_m = route.travelled_m[at]};
}

}  // namespace

Result<std::vector<RouteFrame>> PlaceOnRoute(const std::vector<SelectedFrames>& drives,
                                             int held_out_every) {
  const Route route{drives.front(), TravelledMetres(drives.front().dataset.frames)};
  const auto every = static_cast<std::size_t>(held_out_every);
  std::vector<RouteFrame> all;
  for (std::size_t drive = 0; drive < drives.size(); ++drive) {
    const Dataset& dataset = drives[drive].dataset;
    if (auto alike = CheckAlike(route.drive, drives[drive]); !alike) {
      return std::move(alike).error();
    }
    for (std::size_t index = 0; index < dataset.frames.size(); ++index) {
      auto placed = PlaceFrame(route, dataset.frames[index]);
      if (!placed) return std::move(placed).error().WithContext(dataset.directory);
      placed->drive = drive;
      placed->is_held_out = index % every == every / 2;
      all.push_back(std::move(*placed));
    }
  }
  return all;
}

std::vector<RegionFrames> DivideRoute(const std::vector<RouteFrame>& frames,
                                      double length_m,
                                      double overlap_m) {
  double route_m = 0.0;
  for (const RouteFrame& frame : frames)
    route_m = std::max(route_m, frame.along_m);
  const auto count =
      static_cast<std::size_t>(std::max(1.0, std::ceil((route_m - overlap_m) / length_m)));
  const double stretch_m = route_m / static_cast<double>(count);
  std::vector<RegionFrames> regions(count);
  for (std::size_t region = 0; region < count; ++region) {
    const double begin_m = static_cast<double>(region) * stretch_m - 0.5 * overlap_m;
    const double end_m = static_cast<double>(region + 1) * stretch_m + 0.5 * overlap_m;
    for (const RouteFrame& frame : frames) {
      if (frame.along_m < begin_m || frame.along_m > end_m) continue;
      (frame.is_held_out ? regions[region].held_out : regions[region].training).push_back(frame);
    }
  }
  return regions;
}

}  // namespace relocd
