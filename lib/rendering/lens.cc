#include "rendering/lens.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "core/counter_random.h"

namespace relocd {
namespace {

constexpr int kSpots = 70;
constexpr int kDrops = 45;
constexpr int kStreaks = 350;
constexpr double kWiperPeriodS = 6.0;

Eigen::Array3f MeanOf(const LinearImage& image) {
  Eigen::Array3f sum = Eigen::Array3f::Zero();
  std::size_t count = 0;
  for (std::size_t i = 0; i < image.pixels.size(); i += 64, ++count)
    sum += image.pixels[i];
  return sum / static_cast<float>(std::max<std::size_t>(count, 1));
}

/// 1 in the middle of a spot, 0 from its edge on.
float SoftDisk(float distance, float radius) {
  const float part = 1.0F - distance / radius;
  return part <= 0.0F ? 0.0F : part * part * (3.0F - 2.0F * part);
}

/// A round spot of the image, in pixels.
struct Disk {
  float x;
  float y;
  float radius;
};

/// Calls `visit(u, v, distance)` for the pixels of the image within a disk.
template <typename Visit>
void ForDisk(int width, int height, const Disk& disk, const Visit& visit) {
  const auto [x, y, radius] = disk;
  const int u_begin = std::max(0, static_cast<int>(x - radius));
  const int u_end = std::min(width, static_cast<int>(x + radius) + 2);
  const int v_begin = std::max(0, static_cast<int>(y - radius));
  const int v_end = std::min(height, static_cast<int>(y + radius) + 2);
  for (int v = v_begin; v < v_end; ++v) {
    for (int u = u_begin; u < u_end; ++u) {
      const float distance = std::hypot(static_cast<float>(u) - x, static_cast<float>(v) - y);
      if (distance < radius) visit(u, v, distance);
    }
  }
}

}  // namespace

Lens::Lens(int width, int height, double dirt, double rain, std::uint64_t seed)
    : width_(width), height_(height), rain_(rain), seed_(seed) {
  if (dirt <= 0.0) return;
  opacity_.assign(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), 0.0F);
  const CounterRandom random(seed ^ 0xD1127U);
  for (std::uint64_t i = 0; i < kSpots; ++i) {
    const float x = random.Unit(4 * i) * static_cast<float>(width);
    const float y = random.Unit(4 * i + 1) * static_cast<float>(height);
    const float size = random.Unit(4 * i + 2);
    const float radius = static_cast<float>(width) * (0.006F + 0.045F * size * size * size);
    const float strength = static_cast<float>(dirt) * (0.25F + 0.6F * random.Unit(4 * i + 3));
    ForDisk(width, height, {x, y, radius}, [&](int u, int v, float distance) {
      float& opacity = opacity_[static_cast<std::size_t>(v) * static_cast<std::size_t>(width_) +
                                static_cast<std::size_t>(u)];
      opacity = 1.0F - (1.0F - opacity) * (1.0F - strength * SoftDisk(distance, radius));
    });
  }
}

void Lens::Apply(LinearImage& image, double time_s, std::uint64_t frame_seed) const {
  if (rain_ > 0.0) {
    ApplyStreaks(image, frame_seed);
    ApplyDrops(image, time_s);
  }
  if (!opacity_.empty()) ApplyDirt(image);
}

void Lens::ApplyDirt(LinearImage& image) const {
  // Out of focus, dirt is a veil that scatters what the whole image has.
  const Eigen::Array3f veil = 0.45F * MeanOf(image);
  for (std::size_t i = 0; i < image.pixels.size(); ++i)
    image.pixels[i] += opacity_[i] * (veil - image.pixels[i]);
}

void Lens::ApplyDrops(LinearImage& image, double time_s) const {
  const LinearImage before = image;
  const double sweeps = time_s / kWiperPeriodS;
  const auto sweep = static_cast<std::uint64_t>(std::max(0.0, std::floor(sweeps)));
  const auto since_wiped = static_cast<float>(sweeps - std::floor(sweeps));
  const CounterRandom random(seed_ + 977 * sweep);
  for (std::uint64_t i = 0; i < kDrops; ++i) {
    // Drops fall one after the other between two sweeps of the wiper.
    if (random.Unit(4 * i + 3) > since_wiped * static_cast<float>(rain_)) continue;
    const float x = random.Unit(4 * i) * static_cast<float>(width_);
    const float y = random.Unit(4 * i + 1) * static_cast<float>(height_);
    const float radius = static_cast<float>(width_) * (0.006F + 0.016F * random.Unit(4 * i + 2));
    ForDisk(width_, height_, {x, y, radius}, [&](int u, int v, float distance) {
      // A drop is a small lens that shows the scene upside down and blurred.
      const float dx = static_cast<float>(u) - x;
      const float dy = static_cast<float>(v) - y;
      constexpr float kMagnification = 5.0F;
      const int from_u = std::clamp(static_cast<int>(x - kMagnification * dx), 0, width_ - 1);
      const int from_v = std::clamp(static_cast<int>(y - kMagnification * dy), 0, height_ - 1);
      const float opacity = std::min(1.0F, 2.5F * SoftDisk(distance, radius));
      Eigen::Array3f& pixel = image.At(u, v);
      pixel += opacity * (0.9F * before.At(from_u, from_v) - pixel);
    });
  }
}

void Lens::ApplyStreaks(LinearImage& image, std::uint64_t frame_seed) const {
  const CounterRandom random(frame_seed ^ 0x5742EA4ULL);
  const Eigen::Array3f bright = 1.6F * MeanOf(image);
  const auto count = static_cast<std::uint64_t>(kStreaks * rain_);
  for (std::uint64_t i = 0; i < count; ++i) {
    const float x = random.Unit(5 * i) * static_cast<float>(width_);
    const float y = random.Unit(5 * i + 1) * static_cast<float>(height_);
    const float nearness = random.Unit(5 * i + 2);
    const float length = static_cast<float>(height_) * (0.02F + 0.10F * nearness * nearness);
    const float slant = 0.08F * (random.Unit(5 * i + 3) - 0.3F);
    const float opacity = 0.10F + 0.12F * random.Unit(5 * i + 4);
    for (int step = 0; step < static_cast<int>(length); ++step) {
      const int u = static_cast<int>(x + slant * static_cast<float>(step));
      const int v = static_cast<int>(y) + step;
      if (u < 0 || u >= width_ || v >= height_) break;
      Eigen::Array3f& pixel = image.At(u, v);
      pixel += opacity * (bright - pixel);
    }
  }
}

}  // namespace relocd
