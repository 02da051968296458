#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "core/result.h"

namespace relocd {

/// The conditions of one drive through a world.
struct Session {
  std::string name = "noon";  ///< As it was parsed from.

  // Light.
  double sun_azimuth_rad = 0.6;    ///< From W's x towards y.
  double sun_elevation_rad = 0.9;  ///< Above the horizon.
  double sun_strength = 1.0;       ///< 0: overcast.
  double sky_brightness = 1.0;     ///< 0.02: dusk.
  bool lamps_on = false;
  double haze_per_m = 0.0004;  ///< Extinction.

  // Weather.
  double wetness = 0.0;  ///< Of the road, in [0, 1].
  double rain = 0.0;     ///< Streaks and drops, in [0, 1].

  // Others on the road.
  std::uint64_t parked_seed = 1;  ///< Which spots are taken, by what.
  double parked_part = 0.6;       ///< Of the spots that are taken.
  double cars_per_km = 0.0;       ///< Moving.
  double pedestrians_per_km = 0.0;

  // The drive.
  double lateral_offset_m = 0.0;  ///< To the left of the route.
  double lateral_sway_m = 0.1;    ///< Slow wandering about that.
  double speed_factor = 1.0;

  // The camera.
  double exposure_hunting = 0.0;  ///< Amplitude, in stops.
  double lens_dirt = 0.0;         ///< In [0, 1].
};

/// One word of a session's name, and what it means.
struct SessionTrait {
  std::string name;
  std::string description;
};

/// All words, in the order in which they are listed.
std::vector<SessionTrait> SessionTraits();

/// The conditions by name: words joined by `+`, as in `evening+wet+traffic`, each of which changes
/// what came before it.
///
/// @return kInvalidInput naming the unknown word, the nearest one, and all that there are.
Result<Session> ParseSession(std::string_view name);

}  // namespace relocd
