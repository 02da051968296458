#pragma once

#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "camera/image.h"

namespace relocd {

/// A picture of waves in all directions and of several sizes: everywhere texture, nowhere twice the
/// same. Defined for every real (u, v), so that views of it can be rendered.
class Texture {
 public:
  explicit Texture(unsigned seed, double finest_wave_px = 9.0) {
    std::mt19937 engine(seed);
    std::uniform_real_distribution<double> uniform(0.0, 1.0);
    constexpr int kWaves = 40;
    constexpr double kTurn = 6.283185307179586;
    for (int wave = 0; wave < kWaves; ++wave) {
      const double direction = kTurn * uniform(engine);
      const double length = finest_wave_px * std::pow(8.0, uniform(engine));
      waves_.push_back({kTurn / length * std::cos(direction),
                        kTurn / length * std::sin(direction),
                        kTurn * uniform(engine)});
    }
  }

  /// Gray, about 20 to 235.
  [[nodiscard]] double At(double u, double v) const {
    double sum = 0.0;
    for (const Wave& wave : waves_) {
      sum += std::sin(wave.u * u + wave.v * v + wave.phase);
    }
    constexpr double kMiddle = 128.0;
    constexpr double kContrast = 20.0;
    return std::min(std::max(kMiddle + kContrast * sum, 0.0), 255.0);
  }

  [[nodiscard]] GrayImage Image(int width,
                                int height,
                                double shift_u = 0.0,
                                double shift_v = 0.0) const {
    GrayImage image{.width = width, .height = height, .pixels = {}};
    for (int v = 0; v < height; ++v) {
      for (int u = 0; u < width; ++u) {
        image.pixels.push_back(
            static_cast<std::uint8_t>(std::lround(At(u + shift_u, v + shift_v))));
      }
    }
    return image;
  }

 private:
  struct Wave {
    double u = 0.0;
    double v = 0.0;
    double phase = 0.0;
  };
  std::vector<Wave> waves_;
};

}  // namespace relocd
