#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Geometry>

#include "camera/image.h"
#include "camera/pinhole_camera.h"
#include "core/counter_random.h"
#include "features/gradient_histograms.h"
#include "geometry/pose3.h"
#include "scene_coordinates/head.h"
#include "scene_coordinates/map_file.h"

namespace relocd {

/// A picture in which no two places look alike.
inline GrayImage MakeTexturedImage(int width, int height, std::uint64_t seed) {
  const CounterRandom random(seed);
  GrayImage image{.width = width, .height = height, .pixels = {}};
  const auto lattice = [&](int scale, double u, double v) {  // bilinear noise
    const auto at = [&](int x, int y) {
      const auto bits =
          random.Bits((static_cast<std::uint64_t>(scale) << 40U) +
                      (static_cast<std::uint64_t>(y) << 20U) + static_cast<std::uint64_t>(x));
      return static_cast<double>(bits >> 40U) / static_cast<double>(1U << 24U);
    };
    const int x = static_cast<int>(u / scale);
    const int y = static_cast<int>(v / scale);
    const double a = u / scale - x;
    const double b = v / scale - y;
    return (1.0 - b) * ((1.0 - a) * at(x, y) + a * at(x + 1, y)) +
           b * ((1.0 - a) * at(x, y + 1) + a * at(x + 1, y + 1));
  };
  for (int v = 0; v < height; ++v) {
    for (int u = 0; u < width; ++u) {
      const double value =
          0.25 * lattice(3, u, v) + 0.35 * lattice(7, u, v) + 0.4 * lattice(19, u, v);
      image.pixels.push_back(static_cast<std::uint8_t>(255.0 * value));
    }
  }
  return image;
}

/// A network that is linear in its inputs: hidden units carry their positive and negative parts.
inline Head MakeLinearHead(const Eigen::MatrixXd& weights, const Eigen::VectorXd& bias) {
  const auto inputs = static_cast<int>(weights.rows());
  Head head{.shape = {.inputs = inputs, .width = 2 * inputs, .blocks = 0},
            .centre_W = Eigen::Vector3d::Zero(),
            .scale_m = 1.0,
            .layers = {}};
  for (int layer = 0; layer < head.shape.layer_count(); ++layer) {
    const int rows = head.shape.LayerInputs(layer);
    const int columns = head.shape.LayerOutputs(layer);
    using RowMajor = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
    RowMajor matrix = RowMajor::Zero(rows, columns);
    Eigen::VectorXf offset = Eigen::VectorXf::Zero(columns);
    if (layer == 0) {
      matrix.leftCols(inputs).setIdentity();
      matrix.rightCols(inputs) = -RowMajor::Identity(inputs, inputs);
    } else if (layer + 1 < head.shape.layer_count()) {
      matrix.setIdentity();
    } else {
      matrix.topRows(inputs) = weights.cast<float>();
      matrix.bottomRows(inputs) = -weights.cast<float>();
      offset = bias.cast<float>();
    }
    head.layers.push_back({.inputs = rows,
                           .outputs = columns,
                           .weights = {matrix.data(), matrix.data() + matrix.size()},
                           .bias = {offset.data(), offset.data() + offset.size()}});
  }
  return head;
}

/// A real map that knows one image by heart: it has fewer cells than a feature has dimensions, so
/// that a linear function gives every cell its point, 6 to 14 m before the camera.
inline SceneMap MakeOneImageMap(const GrayImage& image,
                                const CameraIntrinsics& intrinsics,
                                const Pose3& X_WC) {
  constexpr int kDimensions = 192;
  SceneMap map;
  map.camera = intrinsics;
  map.features = GradientHistogramsForImage(intrinsics.width, intrinsics.height);
  map.cells_per_image = 120;
  map.id = "0123456789abcdef0123456789abcdef0123456789abcdef0123456789abcdef";
  const std::unique_ptr<GradientHistograms> extractor =
      GradientHistograms::Create(map.features).value();

  constexpr std::size_t kAllCells = 1'000'000;
  CellFeatures features;
  RELOCD_CHECK(extractor->Extract(image, kAllCells, features), "the map's own image");
  map.whitening = FitWhitening(features.values, extractor->dimension(), kDimensions).value();
  RELOCD_CHECK(extractor->Extract(image, map.cells_per_image, features), "the map's own image");
  std::vector<float> whitened(features.size() * kDimensions);
  map.whitening.Apply(features.values, whitened);
  using RowMajor = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  const auto cells = static_cast<Eigen::Index>(features.size());
  const Eigen::MatrixXd inputs =
      Eigen::Map<const RowMajor>(whitened.data(), cells, kDimensions).cast<double>();

  const PinholeCamera camera(intrinsics);
  Eigen::MatrixXd targets = Eigen::MatrixXd::Zero(cells, kHeadOutputs);
  for (Eigen::Index cell = 0; cell < cells; ++cell) {
    const Eigen::Vector2d pixel = features.pixels[static_cast<std::size_t>(cell)].cast<double>();
    const double depth = 10.0 + 4.0 * std::sin(0.05 * pixel.x() + 0.09 * pixel.y());
    const Eigen::Vector2d ray = camera.Unproject(pixel).value();
    targets.row(cell).head<3>() = X_WC * Eigen::Vector3d(depth * ray.x(), depth * ray.y(), depth);
  }
  const Eigen::RowVectorXd centre = targets.colwise().mean();
  const Eigen::MatrixXd gram =
      inputs * inputs.transpose() + 1e-9 * Eigen::MatrixXd::Identity(cells, cells);
  const Eigen::MatrixXd weights =
      inputs.transpose() * gram.ldlt().solve(targets.rowwise() - centre);

  // The fourth output is the homogeneous coordinate, about one for zero.
  const float w = HomogeneousScale(0.0F);
  MapRegion region;
  region.name = "0";
  region.head = MakeLinearHead(w * weights, w * centre.transpose());
  map.regions.push_back(std::move(region));
  return map;
}

}  // namespace relocd
