#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "core/result.h"

namespace relocd {

/// Colour and coverage of a surface: an 8-bit sRGB image with its mip pyramid, which repeats in
/// both directions. Immutable, hence thread-safe.
///
/// (u, v) = (0, 0) is the corner before the image's first pixel, (1, 1) the one after its last; v
/// goes down the image.
class Texture {
 public:
  /// Sides are powers of two up to this.
  static constexpr int kMaxSide = 4096;

  /// Builds the pyramid; colours are averaged in linear light, weighted by their coverage.
  ///
  /// @param rgba  height x width x 4, row-major, sRGB with straight (not premultiplied) alpha.
  /// @return kInvalidInput unless both sides are powers of two in [1, kMaxSide] and fit `rgba`.
  static Result<Texture> Create(int width, int height, std::span<const std::uint8_t> rgba);

  /// Linear red, green, blue and coverage, each in [0, 1], trilinearly filtered.
  ///
  /// @param footprint  length of what one sample stands for, as part of the texture's width.
  [[nodiscard]] Eigen::Array4f Sample(float u, float v, float footprint) const;

  /// The coverage alone, of the nearest texel of the nearest mip level.
  [[nodiscard]] float SampleAlpha(float u, float v, float footprint) const;

  [[nodiscard]] int width() const { return levels_.front().width; }
  [[nodiscard]] int height() const { return levels_.front().height; }
  [[nodiscard]] bool is_opaque() const { return is_opaque_; }

 private:
  struct Level {
    int width = 0;
    int height = 0;
    std::vector<std::uint32_t> texels;  ///< height x width, red in the lowest byte.
  };

  Texture() = default;

  [[nodiscard]] float LevelOf(float footprint) const;
  /// sRGB and coverage, each in [0, 255]: between texels, sRGB is interpolated.
  static Eigen::Array4f SampleLevel(const Level& level, float u, float v);
  static float AlphaNear(const Level& level, float u, float v);

  std::vector<Level> levels_;  ///< Each half as large as the one before, down to 1 x 1.
  bool is_opaque_ = true;
};

/// Linear light of an 8-bit sRGB value (IEC 61966-2-1), in [0, 1].
float LinearFromSrgb(std::uint8_t value);

/// The sRGB value in [0, 255], not rounded, of linear light in [0, 1].
float SrgbFromLinear(float linear);

}  // namespace relocd
