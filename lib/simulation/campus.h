#pragma once

#include <cstdint>

#include "core/result.h"
#include "simulation/world.h"

namespace relocd {

/// The world `campus`: a district of a small town with a university, made from nothing but a seed.
/// Its route goes once round a block, with a blind alley and its turning circle on the way: 620 m
/// to 700 m in all. The same seed gives the same world, byte for byte; another one has other
/// houses, and streets of other lengths.
Result<World> MakeCampus(std::uint64_t seed);

}  // namespace relocd
