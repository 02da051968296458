#pragma once

#include <vector>

#include "camera/dataset.h"
#include "core/result.h"
#include "scene_coordinates/map_file.h"

namespace relocd {

/// Measures for each region how much the covariances of its poses must grow, and from which
/// confidence poses are right, and sets it in the map.
///
/// Covariances are compared with the errors of frames that the map was not trained on. For the
/// confidence, the same frames are looked for mirrored, too: they look like this world but show no
/// place of it, so that every pose found in them is wrong.
///
/// @return kInvalidInput when an image cannot be read.
Result<void> CalibrateRegions(const std::vector<DatasetFrame>& held_out,
                              int threads,
                              SceneMap& map);

}  // namespace relocd
