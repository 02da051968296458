#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

namespace relocd {

/// Radiance in linear red, green, blue: row-major, H x W.
struct LinearImage {
  int width = 0;   ///< px
  int height = 0;  ///< px
  std::vector<Eigen::Array3f> pixels;

  static LinearImage Black(int width, int height) {
    return {width,
            height,
            std::vector<Eigen::Array3f>(
                static_cast<std::size_t>(width) * static_cast<std::size_t>(height),
                Eigen::Array3f::Zero())};
  }

  [[nodiscard]] Eigen::Array3f& At(int u, int v) {
    return pixels[static_cast<std::size_t>(v) * static_cast<std::size_t>(width) +
                  static_cast<std::size_t>(u)];
  }
  [[nodiscard]] const Eigen::Array3f& At(int u, int v) const {
    return pixels[static_cast<std::size_t>(v) * static_cast<std::size_t>(width) +
                  static_cast<std::size_t>(u)];
  }
};

/// Distance along the camera's z axis, m: row-major, H x W; infinite where nothing is.
struct DepthImage {
  int width = 0;   ///< px
  int height = 0;  ///< px
  std::vector<float> depths_m;
};

}  // namespace relocd
