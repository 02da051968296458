#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "core/result.h"

namespace relocd {

/// The size of a scene-coordinate head: a residual network of fully connected layers, applied to
/// each cell by itself.
///
///     hidden = relu(features * W + b)
///     block, `blocks` times:  hidden = relu(hidden + f3(relu(f2(relu(f1(hidden))))))
///     twice:  hidden = relu(hidden * W + b)
///     output = hidden * W + b       kHeadOutputs values
struct HeadShape {
  int inputs = 192;
  int width = 256;
  int blocks = 2;

  /// @return kInvalidInput, naming the field, its value and what is allowed.
  [[nodiscard]] Result<void> Validate() const;
  [[nodiscard]] int layer_count() const { return 4 + 3 * blocks; }
  [[nodiscard]] int LayerInputs(int layer) const { return layer == 0 ? inputs : width; }
  [[nodiscard]] int LayerOutputs(int layer) const;
  /// Whether the input of the block that ends with this layer is added to its sum.
  [[nodiscard]] bool EndsBlock(int layer) const {
    return layer >= 1 && layer <= 3 * blocks && layer % 3 == 0;
  }

  friend bool operator==(const HeadShape&, const HeadShape&) = default;
};

/// x, y, z and w of a homogeneous point, and the log-odds that the point is right.
inline constexpr int kHeadOutputs = 5;

/// One fully connected layer: `outputs = inputs * weights + bias`.
struct HeadLayer {
  int inputs = 0;
  int outputs = 0;
  std::vector<float> weights;  ///< inputs x outputs, row-major.
  std::vector<float> bias;     ///< outputs
};

/// What a head says of one cell.
struct ScenePoint {
  Eigen::Vector3f p_WP = Eigen::Vector3f::Zero();  ///< In the map, m.
  float confidence = 0.0F;  ///< Probability that the point is where the cell looks, in [0, 1].
};

/// A trained head: the map of one region.
struct Head {
  HeadShape shape;
  Eigen::Vector3d centre_W = Eigen::Vector3d::Zero();  ///< What an output of zero means, m.
  double scale_m = 1.0;                                ///< What an output of one means.
  std::vector<HeadLayer> layers;                       ///< shape.layer_count() of them.
};

/// A head of this shape with random weights: the start of training. The last layer begins at zero,
/// so that every point begins at the centre.
Head MakeRandomHead(const HeadShape& shape, std::uint64_t seed);

/// The point that the network's kHeadOutputs values stand for.
ScenePoint DecodeHeadOutput(const Head& head, std::span<const float, kHeadOutputs> output);

/// The homogeneous coordinate for the network's fourth value: positive, and about one for zero.
float HomogeneousScale(float raw);
/// Its derivative.
float HomogeneousScaleSlope(float raw);

/// The points of cells with these features (n x shape.inputs, row-major), in plain C++ and float:
/// what the fast engine is compared with.
std::vector<ScenePoint> EvaluateHead(const Head& head, std::span<const float> features);

}  // namespace relocd
