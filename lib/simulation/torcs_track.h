#pragma once

#include <string>
#include <vector>

#include "core/result.h"
#include "simulation/world.h"

namespace relocd {

/// Where tracks are looked for: `root` if it is not empty, else what the environment's
/// RELOCD_TORCS_ROOT says, else /usr/share/games/torcs, where Debian's torcs-data puts them.
std::string TorcsRoot(const std::string& root = "");

/// The names of all tracks, in order; empty where there are none.
std::vector<std::string> ListTorcsTracks(const std::string& root = "");

/// Reads a track of TORCS as a world: its AC3D mesh with its textures, and the road that its XML
/// file describes. W has the mesh's origin, with z up. The route runs along the right-hand lane,
/// a quarter of the width from the middle; other cars come along the left-hand one, and on wide
/// roads also between the two.
///
/// @param name_or_folder  a name of ListTorcsTracks, or, with a slash, a folder FOLDER with
///                        FOLDER.xml in it.
/// @return kUnavailable where there are no tracks at all, or a file cannot be read; kInvalidInput
///         for an unknown name, with the nearest one, a texture that is missing or a damaged file.
Result<World> ReadTorcsTrack(const std::string& name_or_folder, const std::string& root = "");

}  // namespace relocd
