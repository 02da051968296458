#pragma once

#include <cstddef>
#include <memory>
#include <span>

#include "core/result.h"
#include "core/thread_team.h"
#include "features/feature_whitening.h"
#include "scene_coordinates/head.h"

namespace relocd {

/// In which numbers the matrix products are done. Sums and the last layer are always in float.
enum class Precision {
  kFloat32,
  kBfloat16,
  kFastest,  ///< bfloat16 where the CPU multiplies it directly, else float.
};

/// The precision that kFastest stands for on this CPU.
Precision FastestPrecision();

/// A feed-forward network run by oneDNN. Primitives and buffers are made once; Run does not
/// allocate. Each thread of the team takes its part of the rows through all layers, in blocks that
/// stay in the second-level cache, so that threads wait for each other once a call and not once a
/// layer. The result does not depend on their number.
///
/// Thread-bound.
class OnednnLayers {
 public:
  /// A head's layers.
  static Result<std::unique_ptr<OnednnLayers>> ForHead(const Head& head,
                                                       Precision precision,
                                                       std::shared_ptr<ThreadTeam> team);
  /// The whitening of features as one layer, in float.
  static Result<std::unique_ptr<OnednnLayers>> ForWhitening(const FeatureWhitening& whitening,
                                                            std::shared_ptr<ThreadTeam> team);
  ~OnednnLayers();

  [[nodiscard]] int inputs() const;
  [[nodiscard]] int outputs() const;

  /// @param in  rows x inputs(); @param out  rows x outputs(), both row-major, for any number of
  /// rows.
  void Run(std::span<const float> in, std::span<float> out);

  OnednnLayers(const OnednnLayers&) = delete;
  OnednnLayers& operator=(const OnednnLayers&) = delete;
  OnednnLayers(OnednnLayers&&) = delete;
  OnednnLayers& operator=(OnednnLayers&&) = delete;

 private:
  struct Network;
  explicit OnednnLayers(std::unique_ptr<Network> network);

  std::unique_ptr<Network> network_;
};

}  // namespace relocd
