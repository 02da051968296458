#include "simulation/campus_canvas.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>

#include "core/check.h"

namespace relocd {
namespace {

constexpr int kNoiseSide = 512;

std::uint8_t ByteOf(float value) {
  return static_cast<std::uint8_t>(std::clamp(value, 0.0F, 1.0F) * 255.0F + 0.5F);
}

/// Adds smoothly interpolated random values on a grid of `cells` x `cells`.
void AddOctave(int cells, float amplitude, std::uint32_t salt, std::vector<float>& field) {
  const auto corner = [&](int x, int y) {
    return HashedUnit(
               static_cast<std::uint32_t>(x % cells), static_cast<std::uint32_t>(y % cells), salt) -
           0.5F;
  };
  const int size = kNoiseSide / cells;
  for (int y = 0; y < kNoiseSide; ++y) {
    for (int x = 0; x < kNoiseSide; ++x) {
      const float u = static_cast<float>(x % size) / static_cast<float>(size);
      const float v = static_cast<float>(y % size) / static_cast<float>(size);
      const float su = u * u * (3.0F - 2.0F * u);
      const float sv = v * v * (3.0F - 2.0F * v);
      const int cx = x / size;
      const int cy = y / size;
      const float value = (1.0F - sv) * ((1.0F - su) * corner(cx, cy) + su * corner(cx + 1, cy)) +
                          sv * ((1.0F - su) * corner(cx, cy + 1) + su * corner(cx + 1, cy + 1));
      field[static_cast<std::size_t>(y * kNoiseSide + x)] += amplitude * value;
    }
  }
}

}  // namespace

float HashedUnit(std::uint32_t x, std::uint32_t y, std::uint32_t salt) {
  std::uint32_t h = x * 0x8DA6B343U + y * 0xD8163841U + salt * 0xCB1AB31FU;
  h = (h ^ (h >> 15U)) * 0x2C1B3C6DU;
  h = (h ^ (h >> 12U)) * 0x297A2D39U;
  h ^= h >> 15U;
  return static_cast<float>(h >> 8U) / 16777216.0F;
}

TileNoise::TileNoise(CampusRandom random)
    : cloud_(static_cast<std::size_t>(kNoiseSide) * kNoiseSide, 0.5F),
      speckle_(static_cast<std::size_t>(kNoiseSide) * kNoiseSide, 0.5F) {
  float amplitude = 0.55F;
  for (int cells = 4; cells <= 256; cells *= 2) {
    AddOctave(cells, amplitude, static_cast<std::uint32_t>(random.Bits() >> 40U), cloud_);
    amplitude *= 0.6F;
  }
  amplitude = 0.55F;
  for (int cells = 32; cells <= 256; cells *= 2) {
    AddOctave(cells, amplitude, static_cast<std::uint32_t>(random.Bits() >> 40U), speckle_);
    amplitude *= 0.75F;
  }
}

float TileNoise::Sample(const std::vector<float>& field, float u, float v) {
  const float x = (u - std::floor(u)) * kNoiseSide;
  const float y = (v - std::floor(v)) * kNoiseSide;
  const int x0 = static_cast<int>(x);
  const int y0 = static_cast<int>(y);
  const float fx = x - static_cast<float>(x0);
  const float fy = y - static_cast<float>(y0);
  const auto at = [&](int column, int row) {
    return field[static_cast<std::size_t>((row % kNoiseSide) * kNoiseSide + column % kNoiseSide)];
  };
  return (1.0F - fy) * ((1.0F - fx) * at(x0, y0) + fx * at(x0 + 1, y0)) +
         fy * ((1.0F - fx) * at(x0, y0 + 1) + fx * at(x0 + 1, y0 + 1));
}

Canvas::Canvas(int width, int height, const Paint& paint)
    : width_(width),
      height_(height),
      pixels_(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), paint) {}

void Canvas::Blend(int x, int y, float part, const Paint& paint) {
  if (x < 0 || y < 0 || x >= width_ || y >= height_ || !(part > 0.0F)) return;
  Paint& pixel = At(x, y);
  const float weight = std::min(part, 1.0F) * paint[3];
  const float coverage = pixel[3] + weight * (1.0F - pixel[3]);
  // Where nothing was painted yet the colour counts fully, so that edges get no halo.
  const float share = coverage > 0.0F ? weight / coverage : 0.0F;
  pixel.head<3>() += std::min(share, 1.0F) * (paint.head<3>() - pixel.head<3>());
  pixel[3] = coverage;
}

void Canvas::FillRectangle(const Eigen::Vector2f& low,
                           const Eigen::Vector2f& high,
                           const Paint& paint) {
  const auto covered = [](float from, float to, int pixel) {
    const auto start = static_cast<float>(pixel);
    return std::clamp(std::min(to, start + 1.0F) - std::max(from, start), 0.0F, 1.0F);
  };
  for (int y = static_cast<int>(std::floor(low.y())); y <= static_cast<int>(high.y()); ++y) {
    for (int x = static_cast<int>(std::floor(low.x())); x <= static_cast<int>(high.x()); ++x)
      Blend(x, y, covered(low.x(), high.x(), x) * covered(low.y(), high.y(), y), paint);
  }
}

void Canvas::FillEllipse(const Eigen::Vector2f& centre,
                         const Eigen::Vector2f& radii,
                         float angle_rad,
                         const Paint& paint) {
  const float reach = radii.maxCoeff() + 1.0F;
  const float c = std::cos(angle_rad);
  const float s = std::sin(angle_rad);
  for (int y = static_cast<int>(std::floor(centre.y() - reach));
       y <= static_cast<int>(centre.y() + reach);
       ++y) {
    for (int x = static_cast<int>(std::floor(centre.x() - reach));
         x <= static_cast<int>(centre.x() + reach);
         ++x) {
      const Eigen::Vector2f offset =
          Eigen::Vector2f(static_cast<float>(x) + 0.5F, static_cast<float>(y) + 0.5F) - centre;
      const float along = (c * offset.x() + s * offset.y()) / radii.x();
      const float across = (c * offset.y() - s * offset.x()) / radii.y();
      Blend(x, y, (1.0F - std::hypot(along, across)) * radii.minCoeff() + 0.5F, paint);
    }
  }
}

void Canvas::DrawStroke(const Eigen::Vector2f& from,
                        const Eigen::Vector2f& to,
                        float width,
                        const Paint& paint) {
  const Eigen::Array2f low = from.array().min(to.array()) - width;
  const Eigen::Array2f high = from.array().max(to.array()) + width;
  const Eigen::Vector2f step = to - from;
  const float squared = std::max(step.squaredNorm(), 1e-6F);
  for (int y = static_cast<int>(std::floor(low.y())); y <= static_cast<int>(high.y()); ++y) {
    for (int x = static_cast<int>(std::floor(low.x())); x <= static_cast<int>(high.x()); ++x) {
      const Eigen::Vector2f p(static_cast<float>(x) + 0.5F, static_cast<float>(y) + 0.5F);
      const float part = std::clamp((p - from).dot(step) / squared, 0.0F, 1.0F);
      Blend(x, y, 0.5F * width - (from + part * step - p).norm() + 0.5F, paint);
    }
  }
}

void Canvas::DrawFrame(const Eigen::Vector2f& low,
                       const Eigen::Vector2f& high,
                       float width,
                       const Paint& paint) {
  FillRectangle(low, {high.x(), low.y() + width}, paint);
  FillRectangle({low.x(), high.y() - width}, high, paint);
  FillRectangle({low.x(), low.y() + width}, {low.x() + width, high.y() - width}, paint);
  FillRectangle({high.x() - width, low.y() + width}, {high.x(), high.y() - width}, paint);
}

Texture Canvas::ToTexture() const {
  std::vector<std::uint8_t> rgba;
  rgba.reserve(4 * pixels_.size());
  for (const Paint& pixel : pixels_) {
    for (int channel = 0; channel < 4; ++channel)
      rgba.push_back(ByteOf(pixel[channel]));
  }
  auto texture = Texture::Create(width_, height_, rgba);
  RELOCD_CHECK(texture.has_value(), "canvases have sides that are powers of two");
  return *std::move(texture);
}

}  // namespace relocd
