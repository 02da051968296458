#pragma once

#include <span>

#include "simulation/torcs_layout.h"
#include "simulation/world.h"

namespace relocd {

/// A line along a closed road at a constant distance from its middle, with points 1 m apart and
/// corners rounded such that curvature changes gradually.
///
/// @param stations_W  with their coordinates in W; the last one closes the loop.
/// @param to_left_m  from the middle; negative is to the right.
Path MakeTorcsLane(std::span<const TorcsStation> stations_W, double to_left_m);

/// The same line in the other direction.
Path Reversed(Path path);

}  // namespace relocd
