#include "features/gradient_maps.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "core/check.h"

// The same source is compiled for three instruction sets and chosen when the program starts.
// Without fused multiply-add (-ffp-contract=off) all give the same bits.
#define RELOCD_VECTORISED \
  __attribute__((target_clones("default", "arch=x86-64-v3", "arch=x86-64-v4")))

namespace relocd {
namespace {

constexpr int kBins = GradientMaps::kOrientations;

/// Eight orientations of one place, unaligned.
using Bins = float __attribute__((vector_size(kBins * sizeof(float)), aligned(4), may_alias));

constexpr double kFineSigmaPx = 2.5;  // of the octave's pixels, as are all below
constexpr double kCoarseSigmaPx = 5.0;
constexpr int kInnerRadiusPx = 6;
constexpr int kOuterRadiusPx = 12;

std::vector<float> GaussianKernel(double sigma) {
  const int radius = static_cast<int>(std::ceil(2.2 * sigma));
  std::vector<float> kernel;
  double sum = 0.0;
  for (int offset = -radius; offset <= radius; ++offset) {
    sum += std::exp(-0.5 * offset * offset / (sigma * sigma));
  }
  for (int offset = -radius; offset <= radius; ++offset) {
    kernel.push_back(static_cast<float>(std::exp(-0.5 * offset * offset / (sigma * sigma)) / sum));
  }
  return kernel;
}

/// One row of the image as seen by the gradient: the row and its neighbours, the border repeated.
struct RowTriple {
  const float* above;
  const float* here;
  const float* below;
};

/// The Sobel gradient of a row.
RELOCD_VECTORISED void GradientRow(const RowTriple& rows, int width, float* gx, float* gy) {
  const auto at = [&rows, gx, gy](int x, int left, int right) {
    gx[x] = (rows.above[right] - rows.above[left]) + (rows.below[right] - rows.below[left]) +
            2.0F * (rows.here[right] - rows.here[left]);
    gy[x] = (rows.below[left] - rows.above[left]) + (rows.below[right] - rows.above[right]) +
            2.0F * (rows.below[x] - rows.above[x]);
  };
  at(0, 0, 1);
  for (int x = 1; x + 1 < width; ++x) {
    at(x, x - 1, x + 1);
  }
  at(width - 1, width - 2, width - 1);
}

/// Half-rectified projections of the gradient on eight directions, interleaved.
RELOCD_VECTORISED void OrientationRow(const float* gx, const float* gy, int width, float* out) {
  static constexpr float kDiagonal = 0.70710678F;
  static constexpr Bins kCosines = {1, kDiagonal, 0, -kDiagonal, -1, -kDiagonal, 0, kDiagonal};
  static constexpr Bins kSines = {0, kDiagonal, 1, kDiagonal, 0, -kDiagonal, -1, -kDiagonal};
  for (int x = 0; x < width; ++x) {
    const Bins projections = gx[x] * kCosines + gy[x] * kSines;
    *reinterpret_cast<Bins*>(out + static_cast<std::ptrdiff_t>(x) * kBins) =
        projections > 0.0F ? projections : Bins{};
  }
}

/// Smooths along a row and keeps every `step`-th place. `in` has `radius` places of padding on
/// either side.
RELOCD_VECTORISED void SmoothRow(
    const float* in, std::span<const float> kernel, int step, int columns, float* out) {
  const int taps = static_cast<int>(kernel.size());
  for (int column = 0; column < columns; ++column) {
    Bins sum = {};
    const float* place = in + static_cast<std::ptrdiff_t>(column) * step * kBins;
    for (int tap = 0; tap < taps; ++tap) {
      sum += *reinterpret_cast<const Bins*>(place + static_cast<std::ptrdiff_t>(tap) * kBins) *
             kernel[static_cast<std::size_t>(tap)];
    }
    *reinterpret_cast<Bins*>(out + static_cast<std::ptrdiff_t>(column) * kBins) = sum;
  }
}

/// Weighted sum of whole rows: the vertical half of the smoothing.
RELOCD_VECTORISED void SumRows(std::span<const float* const> rows,
                               std::span<const float> kernel,
                               std::size_t size,
                               float* out) {
  const float centre_weight = kernel[0];
  for (std::size_t i = 0; i < size; ++i) {
    out[i] = centre_weight * rows[0][i];
  }
  for (std::size_t tap = 1; tap < rows.size(); ++tap) {
    const float weight = kernel[tap];
    const float* row = rows[tap];
    for (std::size_t i = 0; i < size; ++i) {
      out[i] += weight * row[i];
    }
  }
}

/// A row of places with the border repeated into its padding.
void PadRow(float* row, int places, int padding) {
  for (int pad = 0; pad < padding; ++pad) {
    float* left = row + static_cast<std::ptrdiff_t>(pad) * kBins;
    std::copy_n(row + static_cast<std::ptrdiff_t>(padding) * kBins, kBins, left);
    float* right = row + static_cast<std::ptrdiff_t>(padding + places + pad) * kBins;
    std::copy_n(row + static_cast<std::ptrdiff_t>(padding + places - 1) * kBins, kBins, right);
  }
}

/// Sums of rows with the border repeated, for some of the out rows: r is centred on in row r *
/// step.
void SmoothColumns(const std::vector<float>& in,
                   int in_rows,
                   std::span<const float> kernel,
                   int step,
                   PartRange out_rows,
                   std::vector<float>& out) {
  const std::size_t row_size = in.size() / static_cast<std::size_t>(in_rows);
  const int radius = static_cast<int>(kernel.size()) / 2;
  std::array<const float*, 64> rows{};
  RELOCD_CHECK(kernel.size() <= rows.size(), "smoothing kernel is too long");
  for (int row = out_rows.begin; row < out_rows.end; ++row) {
    for (std::size_t tap = 0; tap < kernel.size(); ++tap) {
      const int from = std::clamp(row * step + static_cast<int>(tap) - radius, 0, in_rows - 1);
      rows[tap] = in.data() + static_cast<std::size_t>(from) * row_size;
    }
    SumRows({rows.data(), kernel.size()},
            kernel,
            row_size,
            out.data() + static_cast<std::size_t>(row) * row_size);
  }
}

RELOCD_VECTORISED void HalveRow(const float* upper, const float* lower, int width, float* out) {
  for (int x = 0; x < width; ++x) {
    out[x] = 0.25F * (upper[2 * x] + upper[2 * x + 1] + lower[2 * x] + lower[2 * x + 1]);
  }
}

/// sum(roots * sqrt(histogram)) / sqrt(sum(histogram)).
RELOCD_VECTORISED float RootProduct(const float* roots, const float* histogram) {
  constexpr float kTiny = 1e-6F;
  Bins products = {};
  Bins sums = {};
  for (int i = 0; i < GradientMaps::kDescriptorSize; i += kBins) {
    Bins square_roots;
    for (int bin = 0; bin < kBins; ++bin) {
      square_roots[bin] = std::sqrt(histogram[i + bin]);
    }
    products += *reinterpret_cast<const Bins*>(roots + i) * square_roots;
    sums += *reinterpret_cast<const Bins*>(histogram + i);
  }
  float product = 0.0F;
  float sum = kTiny;
  for (int bin = 0; bin < kBins; ++bin) {
    product += products[bin];
    sum += sums[bin];
  }
  return product / std::sqrt(sum);
}

/// Coarse octaves keep every pixel, so that a cell's place in them is near enough.
int StepOfOctave(int octave) {
  return octave < 3 ? 2 : 1;
}

/// Offsets of the sixteen ring points, in the octave's pixels. All are multiples of 2, so that they
/// are places of the thinned grid.
constexpr std::array<std::array<int, 2>, GradientMaps::kPoints> kPointOffsets = {{
    {0, 0},
    {kInnerRadiusPx, 0},
    {4, 4},
    {0, kInnerRadiusPx},
    {-4, 4},
    {-kInnerRadiusPx, 0},
    {-4, -4},
    {0, -kInnerRadiusPx},
    {4, -4},
    {kOuterRadiusPx, 0},
    {8, 8},
    {0, kOuterRadiusPx},
    {-8, 8},
    {-kOuterRadiusPx, 0},
    {-8, -8},
    {0, -kOuterRadiusPx},
    {8, -8},
}};
/// The others are so small that sharing them out takes longer than it saves.
constexpr int kSharedOctaves = 2;
constexpr std::size_t kFinePoints = 9;  // the centre and the inner ring

}  // namespace

void GradientMaps::Compute(
    std::span<const float> pixels, int width, int height, int octaves, ThreadTeam& team) {
  RELOCD_CHECK(pixels.size() == static_cast<std::size_t>(width) * static_cast<std::size_t>(height),
               "pixels must be width * height");
  RELOCD_CHECK(octaves >= 1 && (width >> (octaves - 1)) >= 4 && (height >> (octaves - 1)) >= 4,
               "the image must have four pixels at the last octave");
  octaves_.resize(static_cast<std::size_t>(octaves));
  for (int index = 0; index < octaves; ++index) {
    Octave& octave = octaves_[static_cast<std::size_t>(index)];
    octave.step = StepOfOctave(index);
    octave.image_width = width >> index;
    octave.image_height = height >> index;
    octave.image.resize(static_cast<std::size_t>(octave.image_width) *
                        static_cast<std::size_t>(octave.image_height));
    if (index == 0) {
      std::copy(pixels.begin(), pixels.end(), octave.image.begin());
    } else {
      const Octave& finer = octaves_[static_cast<std::size_t>(index - 1)];
      for (int y = 0; y < octave.image_height; ++y) {
        const float* upper = finer.image.data() + std::ptrdiff_t{2} * y * finer.image_width;
        HalveRow(upper,
                 upper + finer.image_width,
                 octave.image_width,
                 octave.image.data() + static_cast<std::ptrdiff_t>(y) * octave.image_width);
      }
    }
    ComputeOctave(octave, index < kSharedOctaves ? team : alone_);
  }
}

void GradientMaps::ComputeOctave(Octave& octave, ThreadTeam& team) {
  const std::vector<float> fine_kernel = GaussianKernel(kFineSigmaPx);
  const std::vector<float> coarse_kernel = GaussianKernel(
      std::sqrt(kCoarseSigmaPx * kCoarseSigmaPx - kFineSigmaPx * kFineSigmaPx) / octave.step);
  octave.columns = (octave.image_width + octave.step - 1) / octave.step;
  octave.rows = (octave.image_height + octave.step - 1) / octave.step;
  const std::size_t row_size = static_cast<std::size_t>(octave.columns) * kBins;
  const std::size_t grid_size = row_size * static_cast<std::size_t>(octave.rows);
  smoothed_rows_.resize(row_size * static_cast<std::size_t>(octave.image_height));
  octave.fine.resize(grid_size);
  octave.coarse.resize(grid_size);
  part_rows_.resize(std::max(part_rows_.size(), static_cast<std::size_t>(team.size())));

  team.Run([&](int part) {
    SmoothOrientations(octave,
                       fine_kernel,
                       RangeOfPart(octave.image_height, part, team.size()),
                       part_rows_[static_cast<std::size_t>(part)]);
  });
  team.Run([&](int part) {
    SmoothColumns(smoothed_rows_,
                  octave.image_height,
                  fine_kernel,
                  octave.step,
                  RangeOfPart(octave.rows, part, team.size()),
                  octave.fine);
  });
  smoothed_rows_.resize(grid_size);
  team.Run([&](int part) {
    SmoothFine(octave,
               coarse_kernel,
               RangeOfPart(octave.rows, part, team.size()),
               part_rows_[static_cast<std::size_t>(part)]);
  });
  team.Run([&](int part) {
    SmoothColumns(smoothed_rows_,
                  octave.rows,
                  coarse_kernel,
                  1,
                  RangeOfPart(octave.rows, part, team.size()),
                  octave.coarse);
  });
}

void GradientMaps::SmoothOrientations(const Octave& octave,
                                      std::span<const float> kernel,
                                      PartRange rows,
                                      PartRows& buffers) {
  const int width = octave.image_width;
  const int radius = static_cast<int>(kernel.size()) / 2;
  buffers.gx.resize(static_cast<std::size_t>(width));
  buffers.gy.resize(static_cast<std::size_t>(width));
  buffers.padded.resize(static_cast<std::size_t>(width + 2 * radius) * kBins);
  const auto image_row = [&octave](int row) {
    return octave.image.data() +
           static_cast<std::ptrdiff_t>(std::clamp(row, 0, octave.image_height - 1)) *
               octave.image_width;
  };
  for (int y = rows.begin; y < rows.end; ++y) {
    GradientRow({image_row(y - 1), image_row(y), image_row(y + 1)},
                width,
                buffers.gx.data(),
                buffers.gy.data());
    OrientationRow(buffers.gx.data(),
                   buffers.gy.data(),
                   width,
                   buffers.padded.data() + static_cast<std::ptrdiff_t>(radius) * kBins);
    PadRow(buffers.padded.data(), width, radius);
    SmoothRow(buffers.padded.data(),
              kernel,
              octave.step,
              octave.columns,
              smoothed_rows_.data() + static_cast<std::ptrdiff_t>(y) * octave.columns * kBins);
  }
}

void GradientMaps::SmoothFine(const Octave& octave,
                              std::span<const float> kernel,
                              PartRange rows,
                              PartRows& buffers) {
  const std::size_t row_size = static_cast<std::size_t>(octave.columns) * kBins;
  const int radius = static_cast<int>(kernel.size()) / 2;
  buffers.padded.resize(static_cast<std::size_t>(octave.columns + 2 * radius) * kBins);
  for (int row = rows.begin; row < rows.end; ++row) {
    const std::size_t begin = static_cast<std::size_t>(row) * row_size;
    std::copy_n(octave.fine.data() + begin,
                row_size,
                buffers.padded.data() + static_cast<std::ptrdiff_t>(radius) * kBins);
    PadRow(buffers.padded.data(), octave.columns, radius);
    SmoothRow(buffers.padded.data(), kernel, 1, octave.columns, smoothed_rows_.data() + begin);
  }
}

GradientMaps::GridPlace GradientMaps::PlaceInOctave(int octave, float x, float y) const {
  const Octave& maps = octaves_[static_cast<std::size_t>(octave)];
  // Pixel p of octave k covers pixels 2^k p .. 2^k p + 2^k - 1 of the image.
  const float shift = 0.5F * (static_cast<float>(1 << octave) - 1.0F);
  const float scale = 1.0F / static_cast<float>(maps.step << octave);
  return {static_cast<int>(std::lround((x - shift) * scale)),
          static_cast<int>(std::lround((y - shift) * scale))};
}

void GradientMaps::Sample(int octave, float x, float y, std::span<float> histogram) const {
  const Octave& maps = octaves_[static_cast<std::size_t>(octave)];
  const GridPlace centre = PlaceInOctave(octave, x, y);
  for (std::size_t point = 0; point < kPoints; ++point) {
    const int column =
        std::clamp(centre.column + kPointOffsets[point][0] / maps.step, 0, maps.columns - 1);
    const int row = std::clamp(centre.row + kPointOffsets[point][1] / maps.step, 0, maps.rows - 1);
    const std::vector<float>& map = point < kFinePoints ? maps.fine : maps.coarse;
    const std::size_t from =
        (static_cast<std::size_t>(row) * static_cast<std::size_t>(maps.columns) +
         static_cast<std::size_t>(column)) *
        kBins;
    std::copy_n(map.begin() + static_cast<std::ptrdiff_t>(from),
                kBins,
                histogram.begin() + static_cast<std::ptrdiff_t>(point * kBins));
  }
}

float GradientMaps::Affinity(int octave,
                             float x,
                             float y,
                             std::span<const float> reference_roots) const {
  std::array<float, kDescriptorSize> histogram;
  Sample(octave, x, y, histogram);
  return RootProduct(reference_roots.data(), histogram.data());
}

float GradientMaps::Texture(int octave, float x, float y) const {
  const Octave& maps = octaves_[static_cast<std::size_t>(octave)];
  const GridPlace centre = PlaceInOctave(octave, x, y);
  const int column = std::clamp(centre.column, 0, maps.columns - 1);
  const int row = std::clamp(centre.row, 0, maps.rows - 1);
  const float* bins =
      maps.fine.data() + (static_cast<std::ptrdiff_t>(row) * maps.columns + column) * kBins;
  float sum = 0.0F;
  for (int bin = 0; bin < kBins; ++bin) {
    sum += bins[bin];
  }
  return sum;
}

}  // namespace relocd
