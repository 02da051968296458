#include "features/gradient_histograms.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>
#include <utility>

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

namespace relocd {
namespace {

constexpr int kDescriptor = GradientMaps::kDescriptorSize;

/// Gradient sums of the camera's noise alone are of this order: it keeps flat cells from being
/// stretched to full contrast, and the logarithm finite.
constexpr float kNoiseEnergy = 200.0F;

/// Of cells on a side. A tile may have at most kTileShare times its even share of the chosen cells.
constexpr int kTileCells = 8;
constexpr double kTileShare = 2.5;

Result<void> CheckRange(const char* field, int value, int low, int high) {
  if (value >= low && value <= high) return {};
  return Error{ErrorKind::kInvalidInput,
               fmt::format("features.{} is {}, must be in [{}, {}]", field, value, low, high)};
}

/// The octaves in which it counts which side of an edge is the brighter one.
constexpr int kPolarOctaves = 2;
constexpr int kFolded = GradientMaps::kDescriptorSize / 2;

/// Values of one octave in a cell's feature.
constexpr int SizeOf(int octave) {
  return octave < kPolarOctaves ? kDescriptor : kFolded;
}

/// Adds up what has opposite directions.
void Fold(std::span<const float> histogram, std::span<float> folded) {
  constexpr std::size_t kOrientations = GradientMaps::kOrientations;
  constexpr std::size_t kHalf = kOrientations / 2;
  for (std::size_t i = 0; i < folded.size(); ++i) {
    const std::size_t at = i / kHalf * kOrientations + i % kHalf;
    folded[i] = histogram[at] + histogram[at + kHalf];
  }
}

void RootNormalise(std::span<float> histogram) {
  float energy = kNoiseEnergy;
  for (const float value : histogram) {
    energy += value;
  }
  const float scale = 1.0F / energy;
  for (float& value : histogram) {
    value = std::sqrt(value * scale);
  }
}

}  // namespace

Result<void> Validate(const GradientHistogramsConfig& config) {
  constexpr int kMaxSide = 8192;
  constexpr int kMinWorkingSide = 64;
  constexpr int kMaxOctaves = 5;
  using Rule = std::tuple<const char*, int, int, int>;
  for (const auto& [field, value, low, high] :
       {Rule{"image_width", config.image_width, 16, kMaxSide},
        Rule{"image_height", config.image_height, 16, kMaxSide},
        Rule{"working_width", config.working_width, kMinWorkingSide, kMaxSide},
        Rule{"working_height", config.working_height, kMinWorkingSide, kMaxSide},
        Rule{"cell_stride", config.cell_stride, 2, 64},
        Rule{"octaves", config.octaves, 1, kMaxOctaves}}) {
    if (auto checked = CheckRange(field, value, low, high); !checked) return checked;
  }
  return {};
}

GradientHistogramsConfig GradientHistogramsForImage(int width, int height) {
  constexpr double kWorkingPixels = 1040.0 * 320.0;
  constexpr double kMaxEnlargement = 2.5;  // beyond it there is nothing more to see
  const double pixels = static_cast<double>(width) * height;
  double scale = std::min(std::sqrt(kWorkingPixels / pixels), kMaxEnlargement);
  if (scale > 0.8 && scale < 1.25) scale = 1.0;
  GradientHistogramsConfig config;
  config.image_width = width;
  config.image_height = height;
  config.working_width = static_cast<int>(std::lround(scale * width));
  config.working_height = static_cast<int>(std::lround(scale * height));
  return config;
}

Result<std::unique_ptr<GradientHistograms>> GradientHistograms::Create(
    const GradientHistogramsConfig& config, std::shared_ptr<ThreadTeam> team) {
  if (auto valid = Validate(config); !valid) return std::move(valid).error();
  cv::setNumThreads(1);  // resizing takes less than waking OpenCV's pool, and callers have threads
  return std::unique_ptr<GradientHistograms>(new GradientHistograms(config, std::move(team)));
}

int GradientHistogramsDimension(const GradientHistogramsConfig& config) {
  int size = 0;
  for (int octave = 0; octave < config.octaves; ++octave) {
    size += SizeOf(octave);
  }
  return size;
}

int GradientHistograms::dimension() const {
  return GradientHistogramsDimension(config_);
}

Result<void> GradientHistograms::Resize(const GrayImage& image, std::vector<float>& working) const {
  if (image.width != config_.image_width || image.height != config_.image_height) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("image is {} x {} pixels, must be {} x {} as in the map",
                             image.width,
                             image.height,
                             config_.image_width,
                             config_.image_height)};
  }
  working.resize(static_cast<std::size_t>(config_.working_width) *
                 static_cast<std::size_t>(config_.working_height));
  // OpenCV has no view of constant memory; nothing is written to the input.
  const cv::Mat in(
      image.height, image.width, CV_8U, const_cast<std::uint8_t*>(image.pixels.data()));
  cv::Mat in_float;
  in.convertTo(in_float, CV_32F);
  cv::Mat out(config_.working_height, config_.working_width, CV_32F, working.data());
  const bool reduces = config_.working_width < config_.image_width;
  cv::resize(in_float, out, out.size(), 0.0, 0.0, reduces ? cv::INTER_AREA : cv::INTER_LINEAR);
  return {};
}

Result<void> GradientHistograms::Extract(const GrayImage& image,
                                         std::size_t max_cells,
                                         CellFeatures& features) {
  if (auto resized = Resize(image, working_); !resized) return resized;
  ExtractFromWorkingImage(working_, max_cells, features);
  for (Eigen::Vector2f& pixel : features.pixels) {
    pixel = FromWorking(pixel);
  }
  return {};
}

void GradientHistograms::ExtractFromWorkingImage(std::span<const float> working,
                                                 std::size_t max_cells,
                                                 CellFeatures& features) {
  maps_.Compute(working, config_.working_width, config_.working_height, config_.octaves, *team_);
  ChooseCells(max_cells);
  const auto size = static_cast<std::size_t>(dimension());
  features.dimension = dimension();
  features.pixels.resize(cells_.size());
  features.values.resize(cells_.size() * size);
  team_->Run([&](int part) {
    const PartRange cells = RangeOfPart(static_cast<int>(cells_.size()), part, team_->size());
    for (auto index = static_cast<std::size_t>(cells.begin);
         index < static_cast<std::size_t>(cells.end);
         ++index) {
      const Eigen::Vector2f centre = CellCentre(cells_[index]);
      features.pixels[index] = centre;
      Describe(centre, std::span(features.values).subspan(index * size, size));
    }
  });
}

void GradientHistograms::Describe(const Eigen::Vector2f& centre, std::span<float> feature) const {
  std::array<float, GradientMaps::kDescriptorSize> histogram{};
  for (int octave = 0; octave < config_.octaves; ++octave) {
    const std::span<float> part = feature.first(static_cast<std::size_t>(SizeOf(octave)));
    feature = feature.subspan(part.size());
    if (octave < kPolarOctaves) {
      maps_.Sample(octave, centre.x(), centre.y(), part);
    } else {
      maps_.Sample(octave, centre.x(), centre.y(), histogram);
      Fold(histogram, part);
    }
    RootNormalise(part);
  }
}

Eigen::Vector2f GradientHistograms::CellCentre(const Cell& cell) const {
  const int half = config_.cell_stride / 2;
  return {static_cast<float>(cell.column * config_.cell_stride + half),
          static_cast<float>(cell.row * config_.cell_stride + half)};
}

void GradientHistograms::AppendTile(int first_column, int first_row) {
  const int columns = config_.working_width / config_.cell_stride;
  const int rows = config_.working_height / config_.cell_stride;
  for (int row = first_row; row < std::min(first_row + kTileCells, rows); ++row) {
    for (int column = first_column; column < std::min(first_column + kTileCells, columns);
         ++column) {
      const Eigen::Vector2f centre = CellCentre({0.0F, column, row});
      cells_.push_back({maps_.Texture(0, centre.x(), centre.y()), column, row});
    }
  }
}

void GradientHistograms::ChooseCells(std::size_t max_cells) {
  const int columns = config_.working_width / config_.cell_stride;
  const int rows = config_.working_height / config_.cell_stride;
  const int tile_columns = (columns + kTileCells - 1) / kTileCells;
  const int tile_rows = (rows + kTileCells - 1) / kTileCells;
  const auto tile_limit = static_cast<std::ptrdiff_t>(
      std::ceil(kTileShare * static_cast<double>(max_cells) / (tile_columns * tile_rows)));
  const auto more_texture = [](const Cell& a, const Cell& b) {
    return std::tuple(b.texture, a.row, a.column) < std::tuple(a.texture, b.row, b.column);
  };
  cells_.clear();
  for (int tile = 0; tile < tile_columns * tile_rows; ++tile) {
    const auto tile_begin = static_cast<std::ptrdiff_t>(cells_.size());
    AppendTile(tile % tile_columns * kTileCells, tile / tile_columns * kTileCells);
    if (std::ssize(cells_) - tile_begin > tile_limit) {
      std::nth_element(cells_.begin() + tile_begin,
                       cells_.begin() + tile_begin + tile_limit,
                       cells_.end(),
                       more_texture);
      cells_.resize(static_cast<std::size_t>(tile_begin + tile_limit));
    }
  }
  if (cells_.size() > max_cells) {
    std::nth_element(cells_.begin(),
                     cells_.begin() + static_cast<std::ptrdiff_t>(max_cells),
                     cells_.end(),
                     more_texture);
    cells_.resize(max_cells);
  }
  std::sort(cells_.begin(), cells_.end(), [](const Cell& a, const Cell& b) {
    return std::tuple(a.row, a.column) < std::tuple(b.row, b.column);
  });
}

Eigen::Vector2f GradientHistograms::ToWorking(const Eigen::Vector2f& pixel) const {
  const Eigen::Vector2f scale(
      static_cast<float>(config_.working_width) / static_cast<float>(config_.image_width),
      static_cast<float>(config_.working_height) / static_cast<float>(config_.image_height));
  return ((pixel.array() + 0.5F) * scale.array() - 0.5F).matrix();
}

Eigen::Vector2f GradientHistograms::FromWorking(const Eigen::Vector2f& pixel) const {
  const Eigen::Vector2f scale(
      static_cast<float>(config_.working_width) / static_cast<float>(config_.image_width),
      static_cast<float>(config_.working_height) / static_cast<float>(config_.image_height));
  return ((pixel.array() + 0.5F) / scale.array() - 0.5F).matrix();
}

}  // namespace relocd
