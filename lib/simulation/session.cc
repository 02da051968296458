#include "simulation/session.h"

#include <algorithm>
#include <numbers>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "core/nearest_name.h"

namespace relocd {
namespace {

constexpr double Radians(double degrees) {
  return degrees * std::numbers::pi / 180.0;
}

struct Trait {
  SessionTrait words;
  void (*apply)(Session&);
};

void SetSun(Session& session, double azimuth_deg, double elevation_deg, double haze_per_m) {
  session.sun_azimuth_rad = Radians(azimuth_deg);
  session.sun_elevation_rad = Radians(elevation_deg);
  session.haze_per_m = haze_per_m;
}

const std::vector<Trait>& Traits() {
  static const std::vector<Trait> traits{
      {{"noon", "clear sky, the sun high in the south"},
       [](Session& session) { SetSun(session, -80.0, 58.0, 0.0004); }},
      {{"morning", "a low sun in the east, some haze"},
       [](Session& session) { SetSun(session, 10.0, 24.0, 0.0012); }},
      {{"afternoon", "clear sky, the sun in the south-west"},
       [](Session& session) { SetSun(session, -135.0, 36.0, 0.0006); }},
      {{"evening", "a low warm sun in the west"},
       [](Session& session) { SetSun(session, 170.0, 15.0, 0.0008); }},
      {{"overcast", "no sun, no shadows"},
       [](Session& session) {
         session.sun_strength = 0.0;
         session.sky_brightness = std::min(session.sky_brightness, 0.9);
         session.haze_per_m = 0.0012;
       }},
      {{"dusk", "the sun is down, street lamps and windows are lit"},
       [](Session& session) {
         session.sun_strength = 0.0;
         session.sky_brightness = std::min(session.sky_brightness, 0.06);
         session.lamps_on = true;
       }},
      {{"wet", "a wet road that mirrors"}, [](Session& session) { session.wetness = 1.0; }},
      {{"rain", "overcast, wet, rain streaks and drops on the lens"},
       [](Session& session) {
         session.sun_strength = 0.0;
         session.sky_brightness = std::min(session.sky_brightness, 0.6);
         session.haze_per_m = 0.004;
         session.wetness = 1.0;
         session.rain = 1.0;
       }},
      {{"haze", "a view of some hundred metres"},
       [](Session& session) { session.haze_per_m = 0.006; }},
      {{"reparked", "other cars are parked, in other places"},
       [](Session& session) { session.parked_seed += 1000; }},
      {{"empty", "no car is parked"}, [](Session& session) { session.parked_part = 0.0; }},
      {{"traffic", "cars drive and people walk, and hide what is behind them"},
       [](Session& session) {
         session.cars_per_km = 25.0;
         session.pedestrians_per_km = 40.0;
       }},
      {{"left", "one metre to the left of the route"},
       [](Session& session) { session.lateral_offset_m = 1.0; }},
      {{"right", "one metre to the right of the route"},
       [](Session& session) { session.lateral_offset_m = -1.0; }},
      {{"swerving", "wandering half a metre to both sides"},
       [](Session& session) { session.lateral_sway_m = 0.5; }},
      {{"slow", "at 60 % of the usual speed"},
       [](Session& session) { session.speed_factor = 0.6; }},
      {{"fast", "at 140 % of the usual speed"},
       [](Session& session) { session.speed_factor = 1.4; }},
      {{"hunting", "the exposure swings by a stop"},
       [](Session& session) { session.exposure_hunting = 1.0; }},
      {{"dirty", "dirt on the lens"}, [](Session& session) { session.lens_dirt = 1.0; }},
  };
  return traits;
}

}  // namespace

std::vector<SessionTrait> SessionTraits() {
  std::vector<SessionTrait> words;
  for (const Trait& trait : Traits())
    words.push_back(trait.words);
  return words;
}

Result<Session> ParseSession(std::string_view name) {
  Session session;
  session.name = std::string(name);
  SetSun(session, -80.0, 58.0, 0.0004);
  while (true) {
    const std::size_t end = std::min(name.find('+'), name.size());
    const std::string_view word = name.substr(0, end);
    const auto& traits = Traits();
    const auto found = std::find_if(
        traits.begin(), traits.end(), [&](const Trait& trait) { return trait.words.name == word; });
    if (found == traits.end()) {
      std::vector<std::string> known;
      for (const Trait& trait : traits)
        known.push_back(trait.words.name);
      const std::string nearest = NearestName(word, known);
      return Error{ErrorKind::kInvalidInput,
                   fmt::format("session '{}': unknown word '{}'{}; words are {}, joined by +",
                               session.name,
                               word,
                               nearest.empty() ? "" : ", did you mean '" + nearest + "'?",
                               fmt::join(known, ", "))};
    }
    found->apply(session);
    if (end == name.size()) return session;
    name.remove_prefix(end + 1);
  }
}

}  // namespace relocd
