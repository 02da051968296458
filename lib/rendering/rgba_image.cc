#include "rendering/rgba_image.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <utility>

#include <fmt/format.h>

#include "camera/jpeg.h"

namespace relocd {
namespace {

constexpr std::size_t kChannels = 4;

int NearestPowerOfTwo(int side, int max_side) {
  const auto below = static_cast<int>(std::bit_floor(static_cast<unsigned>(side)));
  const int nearest = side - below < 2 * below - side ? below : 2 * below;
  return std::clamp(nearest, 1, max_side);
}

/// What the pixels of one line become: a weighted mean of some of the old ones.
struct Tap {
  std::size_t source = 0;
  float weight = 0.0F;
};

/// For each new pixel the old ones that a tent as wide as the larger of both pixels covers.
std::vector<std::vector<Tap>> MakeTaps(int old_size, int new_size) {
  std::vector<std::vector<Tap>> taps(static_cast<std::size_t>(new_size));
  const double scale = static_cast<double>(old_size) / new_size;
  const double reach = std::max(scale, 1.0);
  for (int i = 0; i < new_size; ++i) {
    const double middle = (i + 0.5) * scale - 0.5;
    auto& line = taps[static_cast<std::size_t>(i)];
    double sum = 0.0;
    for (int j = static_cast<int>(std::ceil(middle - reach)); j <= middle + reach; ++j) {
      const double weight = 1.0 - std::abs(j - middle) / reach;
      if (weight <= 0.0) continue;
      line.push_back({.source = static_cast<std::size_t>(std::clamp(j, 0, old_size - 1)),
                      .weight = static_cast<float>(weight)});
      sum += weight;
    }
    for (Tap& tap : line) {
      tap.weight /= static_cast<float>(sum);
    }
  }
  return taps;
}

/// A mean of pixels, in which colour counts as much as it covers.
struct PixelMean {
  std::array<float, kChannels> covered{};  ///< The colours times their coverage, and the coverage.
  std::array<float, kChannels> plain{};

  void Add(const std::uint8_t* pixel, float weight) {
    const float coverage = weight * static_cast<float>(pixel[3]);
    for (std::size_t c = 0; c < 3; ++c) {
      covered.at(c) += coverage * static_cast<float>(pixel[c]);
      plain.at(c) += weight * static_cast<float>(pixel[c]);
    }
    covered[3] += coverage;
  }

  [[nodiscard]] std::array<std::uint8_t, kChannels> Get() const {
    const auto to_byte = [](float value) {
      return static_cast<std::uint8_t>(std::lround(std::clamp(value, 0.0F, 255.0F)));
    };
    std::array<std::uint8_t, kChannels> mean{};
    for (std::size_t c = 0; c < 3; ++c) {
      mean.at(c) = to_byte(covered[3] > 0.0F ? covered.at(c) / covered[3] : plain.at(c));
    }
    mean[3] = to_byte(covered[3]);
    return mean;
  }
};

std::array<std::uint8_t, kChannels> Mix(const RgbaImage& image,
                                        const std::vector<Tap>& rows,
                                        const std::vector<Tap>& columns) {
  const auto width = static_cast<std::size_t>(image.width);
  PixelMean mean;
  for (const Tap& row : rows) {
    for (const Tap& column : columns) {
      mean.Add(&image.pixels[kChannels * (row.source * width + column.source)],
               row.weight * column.weight);
    }
  }
  return mean.Get();
}

}  // namespace

Result<void> CheckRgbaSize(std::int64_t width, std::int64_t height) {
  const auto is_side = [](std::int64_t side) { return side >= 1 && side <= kMaxImageSide; };
  if (is_side(width) && is_side(height) && width * height <= kMaxImagePixels) return {};
  return Error{ErrorKind::kInvalidInput,
               fmt::format("image of {} x {} px, sides must be in [1, {}] with at most {} pixels",
                           width,
                           height,
                           kMaxImageSide,
                           kMaxImagePixels)};
}

RgbaImage ResampleToPowersOfTwo(RgbaImage image, int max_side) {
  RgbaImage result{.width = NearestPowerOfTwo(image.width, max_side),
                   .height = NearestPowerOfTwo(image.height, max_side),
                   .pixels = {}};
  if (result.width == image.width && result.height == image.height) return image;
  const auto columns = MakeTaps(image.width, result.width);
  const auto rows = MakeTaps(image.height, result.height);
  result.pixels.reserve(kChannels * rows.size() * columns.size());
  for (const auto& row : rows) {
    for (const auto& column : columns) {
      const auto pixel = Mix(image, row, column);
      result.pixels.insert(result.pixels.end(), pixel.begin(), pixel.end());
    }
  }
  return result;
}

}  // namespace relocd
