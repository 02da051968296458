#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "camera/image.h"
#include "core/result.h"

namespace relocd {

/// Dense features of one image: one vector for each of a set of cells of a regular grid.
struct CellFeatures {
  int dimension = 0;
  std::vector<Eigen::Vector2f> pixels;  ///< Cell centres (u, v) in the image that was given.
  std::vector<float> values;            ///< cells x dimension, row-major.

  [[nodiscard]] std::size_t size() const { return pixels.size(); }
};

/// Gives each cell of an image a vector that looks alike where the same place of the world is seen.
///
/// Implementations keep their buffers between images and are thread-bound.
class FeatureExtractor {
 public:
  FeatureExtractor() = default;
  FeatureExtractor(const FeatureExtractor&) = delete;
  FeatureExtractor& operator=(const FeatureExtractor&) = delete;
  FeatureExtractor(FeatureExtractor&&) = delete;
  FeatureExtractor& operator=(FeatureExtractor&&) = delete;
  virtual ~FeatureExtractor() = default;

  [[nodiscard]] virtual int dimension() const = 0;

  /// The features of the `max_cells` cells with the most texture, spread over the image, in
  /// row-major order; of all cells when there are fewer. `features` is overwritten.
  ///
  /// @return kInvalidInput when the image has not the size that this extractor is for.
  virtual Result<void> Extract(const GrayImage& image,
                               std::size_t max_cells,
                               CellFeatures& features) = 0;
};

}  // namespace relocd
