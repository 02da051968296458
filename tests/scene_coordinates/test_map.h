#pragma once

#include <random>
#include <vector>

#include "features/gradient_histograms.h"
#include "scene_coordinates/head.h"
#include "scene_coordinates/map_file.h"

namespace relocd {

inline std::vector<float> RandomFloats(std::size_t count, double sigma, unsigned seed) {
  std::mt19937 engine(seed);
  std::normal_distribution<double> normal(0.0, sigma);
  std::vector<float> values(count);
  for (float& value : values) {
    value = static_cast<float>(normal(engine));
  }
  return values;
}

/// A head whose last layer is random too, so that its points differ.
inline Head MakeTestHead(const HeadShape& shape, unsigned seed) {
  Head head = MakeRandomHead(shape, seed);
  head.centre_W = {10.0, -20.0, 1.5};
  head.scale_m = 30.0;
  HeadLayer& last = head.layers.back();
  last.weights = RandomFloats(last.weights.size(), 0.1, seed + 1);
  last.bias = RandomFloats(last.bias.size(), 0.1, seed + 2);
  for (HeadLayer& layer : head.layers) {
    for (float& value : layer.weights)
      value = RoundToHalf(value);
    for (float& value : layer.bias)
      value = RoundToHalf(value);
  }
  return head;
}

/// A small map with two regions of untrained heads; every value survives half precision.
inline SceneMap MakeTestMap() {
  SceneMap map;
  map.camera = {.fx = 200.0,
                .fy = 201.0,
                .cx = 79.5,
                .cy = 63.5,
                .width = 160,
                .height = 128,
                .distortion = {0.01, 0.0, 0.0, 0.0, 0.0}};
  map.R_WD = Eigen::Quaterniond(0.5, 0.5, -0.5, 0.5);
  map.features.image_width = 160;
  map.features.image_height = 128;
  map.features.working_width = 160;
  map.features.working_height = 128;
  map.features.octaves = 2;
  map.cells_per_image = 150;
  map.whitening.inputs = GradientHistogramsDimension(map.features);
  map.whitening.outputs = 24;
  map.whitening.mean = RandomFloats(272, 0.1, 1);
  map.whitening.basis = RandomFloats(std::size_t{272} * 24, 1.0, 2);
  for (float& value : map.whitening.mean)
    value = RoundToHalf(value);
  for (float& value : map.whitening.basis)
    value = RoundToHalf(value);
  map.training = {.dataset = "street",
                  .program_version = "0.1.0",
                  .seed = 7,
                  .training_frames = 100,
                  .held_out_frames = 10,
                  .median_error_m = 0.25,
                  .p95_error_m = 0.75,
                  .median_error_rad = 0.01,
                  .within_1m = 0.9};
  for (unsigned index = 0; index < 2; ++index) {
    MapRegion region;
    region.name = index == 0 ? "first" : "second";
    region.head = MakeTestHead({.inputs = 24, .width = 32, .blocks = 1}, 10 * index + 3);
    region.calibration = {.covariance_factor = 4.0,
                          .sigma_floor_m = 0.02,
                          .sigma_floor_rad = 0.001,
                          .confidence_threshold = 0.05};
    region.training_poses = {{{1.0F, 2.0F, 3.0F}, 0.5F}, {{2.0F, 2.0F, 3.0F}, 0.75F}};
    map.regions.push_back(region);
  }
  return map;
}

}  // namespace relocd
