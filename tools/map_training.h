#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/result.h"
#include "map_checkpoint.h"
#include "map_dataset.h"
#include "map_evaluation.h"
#include "map_route.h"
#include "scene_coordinates/head_trainer.h"
#include "scene_coordinates/map_file.h"
#include "scene_coordinates/training_set.h"

namespace relocd {

/// How a map is made of a data set.
struct MapTrainingOptions {
  int threads = 2;
  std::uint64_t seed = 1;
  double region_length_m = 150.0;  ///< Longer routes are divided.
  double region_overlap_m = 20.0;
  int held_out_every = 8;         ///< Of the training frames; measures the map, never trains it.
  int whitened_dimensions = 192;  ///< Of the features, as the heads see them.
  TrainingSetConfig cells;
  HeadTrainerConfig head;
  /// The map that is to be written: what is finished is kept beside it, and taken up again. Empty
  /// for none.
  std::string resumable_path;
  double checkpoint_every_s = 30.0;  ///< Within a region.

  /// @return kInvalidInput, naming the field, its value and what is allowed.
  [[nodiscard]] Result<void> Validate() const;
};

/// How a head in training does on a few held-out frames of its region.
struct LiveAccuracy {
  std::size_t region = 0;
  int iteration = 0;
  std::size_t frames = 0;
  std::size_t localized = 0;
  double median_m = 0.0;  ///< Of those.
};

/// A finished map, and how it did on the frames held out of its training.
struct TrainedMap {
  SceneMap map;
  PoseErrors held_out;
  double seconds = 0.0;  ///< Not in the map, so that the same seed gives the same bytes.
  std::vector<FrameLocalization> localizations;
  std::vector<RouteFrame> route;   ///< All frames; those held out are in localizations' order.
  std::vector<LiveAccuracy> live;  ///< By region, then iteration. Not of regions taken up again.
  std::optional<TrainingFolder> folder;  ///< To be removed when the map is written.
};

/// Trains a map on the selected frames of one or more drives along one route, such as in several
/// kinds of light. Shows progress on stderr if that is a terminal.
///
/// @param drives  at least one; the first one's frames divide the route into regions.
/// @return kInvalidInput when the data cannot make a map: too few frames, images of another size,
///         poses that do not move, a world whose up axis is not known, drives elsewhere.
Result<TrainedMap> TrainMap(const std::vector<SelectedFrames>& drives,
                            const MapTrainingOptions& options);

}  // namespace relocd
