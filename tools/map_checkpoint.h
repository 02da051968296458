#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/result.h"
#include "map_dataset.h"
#include "scene_coordinates/head_trainer.h"
#include "scene_coordinates/map_file.h"

namespace relocd {

/// The folder `X.relocmap.partial` beside a map that is being trained: its finished regions, and
/// where the others stand. What is in it is whole at any time, also after a power cut.
///
/// Thread-safe: threads that work on different regions may use it at the same time.
class TrainingFolder {
 public:
  /// Finds what an earlier training left, or begins anew if there is nothing, or what there is
  /// came of other data, options or programs.
  ///
  /// @param fingerprint  of all that the map's bytes depend on.
  /// @return kUnavailable when the folder cannot be made.
  static Result<TrainingFolder> Open(const std::string& map_path, const std::string& fingerprint);

  /// Nothing where there is none, or it is damaged.
  [[nodiscard]] std::optional<MapRegion> FinishedRegion(std::size_t region) const;
  [[nodiscard]] std::optional<TrainerState> State(std::size_t region) const;

  /// @param map  whose only region it is.
  Result<void> KeepRegion(std::size_t region, const SceneMap& map) const;
  Result<void> KeepState(std::size_t region, const TrainerState& state) const;

  /// Removes the folder, when the map is written.
  void Remove() const;

  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  TrainingFolder(std::string path, std::string fingerprint);
  [[nodiscard]] std::string RegionPath(std::size_t region) const;
  [[nodiscard]] std::string StatePath(std::size_t region) const;

  std::string path_;
  std::string fingerprint_;
};

/// The bytes of a state's file, and back. @return nothing when they are not what was written for
/// this fingerprint. Safe for any bytes.
std::string SerializeState(const TrainerState& state, const std::string& fingerprint);
std::optional<TrainerState> ParseState(std::string_view bytes, const std::string& fingerprint);

/// A hash over the frames with their poses, and their images' sizes and times.
std::string FingerprintOf(const std::vector<SelectedFrames>& drives);

}  // namespace relocd
