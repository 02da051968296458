#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "geometry/pose3.h"
#include "scene_coordinates/map_file.h"

namespace relocd {

/// Where a camera is expected to be, from what came before its image.
struct CameraPrior {
  Pose3 X_WC;
  double sigma_m = 0.0;    ///< Of the position, in its least certain direction.
  double sigma_rad = 0.0;  ///< Of the heading.
};

/// Chooses the regions of a map that are worth a try on an image, so that the work for an image
/// does not grow with the map.
///
/// Where a pose is expected, these are the regions that were learned there, the nearest first.
/// Without an expectation they are the region of the last pose and its neighbours on the route.
/// After an image without a pose at least one place is left to the other regions, in turn: an
/// expectation may be wrong.
class RegionSelector {
 public:
  /// Borrows the regions, which must outlive it and not change.
  /// @param limit  of regions for an image, >= 2.
  RegionSelector(const std::vector<MapRegion>& regions, std::size_t limit);

  /// Regions to try on the next image, the likeliest first; at least one, at most the limit.
  [[nodiscard]] std::vector<std::size_t> Choose(const std::optional<CameraPrior>& prior);

  /// Which region gave the image its pose, if one did.
  void Report(std::optional<std::size_t> region);

 private:
  [[nodiscard]] std::vector<std::size_t> Expected(const CameraPrior& prior) const;
  [[nodiscard]] std::vector<std::size_t> AroundLast() const;
  void FillInTurn(std::vector<std::size_t>& chosen);

  const std::vector<MapRegion>& regions_;
  std::size_t limit_;
  std::optional<std::size_t> last_;  ///< The region of the last pose, if the last image gave one.
  std::size_t next_in_turn_ = 0;
};

}  // namespace relocd
