#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "rendering/texture.h"
#include "simulation/campus_random.h"

namespace relocd {

/// sRGB red, green, blue and coverage, each in [0, 1].
using Paint = Eigen::Array4f;

inline Paint OpaquePaint(float red, float green, float blue) {
  return {red, green, blue, 1.0F};
}

/// Grey that is a little warm (positive) or cold.
inline Paint GreyPaint(float grey, float warmth = 0.0F) {
  return {grey + warmth, grey, grey - warmth, 1.0F};
}

/// The same colour, lighter or darker, with its coverage.
inline Paint Shaded(const Paint& paint, float factor) {
  Paint shaded = paint * factor;
  shaded[3] = paint[3];
  return shaded;
}

/// A hash of two numbers in [0, 1).
float HashedUnit(std::uint32_t x, std::uint32_t y, std::uint32_t salt);

/// Noise that repeats with period 1 in both directions, as textures must.
class TileNoise {
 public:
  explicit TileNoise(CampusRandom random);

  /// Clouds of many sizes, the largest a quarter of the period: about 0.5 +- 0.15. Frequencies must
  /// be whole numbers, as in `Cloud(3 * u, 3 * v)`, for the result to repeat with `u` and `v`.
  [[nodiscard]] float Cloud(float u, float v) const { return Sample(cloud_, u, v); }

  /// The same without its large parts: the largest is a 32nd of the period.
  [[nodiscard]] float Speckle(float u, float v) const { return Sample(speckle_, u, v); }

 private:
  static float Sample(const std::vector<float>& field, float u, float v);

  std::vector<float> cloud_;
  std::vector<float> speckle_;
};

/// An image to paint on; pixel (0, 0) is its upper left one.
class Canvas {
 public:
  Canvas(int width, int height, const Paint& paint);

  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }
  [[nodiscard]] Paint& At(int x, int y) {
    return pixels_[static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) +
                   static_cast<std::size_t>(x)];
  }

  /// Sets every pixel to `paint(x, y)`.
  template <typename PaintAt>
  void Fill(PaintAt&& paint) {
    for (int y = 0; y < height_; ++y) {
      for (int x = 0; x < width_; ++x)
        At(x, y) = paint(x, y);
    }
  }

  /// Lengths below are in pixels, edges are softened over one pixel, and what lies outside of the
  /// image is cut off. Coverage grows where something is painted.
  void FillRectangle(const Eigen::Vector2f& low, const Eigen::Vector2f& high, const Paint& paint);
  void FillEllipse(const Eigen::Vector2f& centre,
                   const Eigen::Vector2f& radii,
                   float angle_rad,
                   const Paint& paint);
  void DrawStroke(const Eigen::Vector2f& from,
                  const Eigen::Vector2f& to,
                  float width,
                  const Paint& paint);
  void DrawFrame(const Eigen::Vector2f& low,
                 const Eigen::Vector2f& high,
                 float width,
                 const Paint& paint);

  [[nodiscard]] Texture ToTexture() const;

 private:
  void Blend(int x, int y, float part, const Paint& paint);

  int width_;
  int height_;
  std::vector<Paint> pixels_;
};

}  // namespace relocd
