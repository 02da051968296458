#include "rendering/texture.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include <fmt/format.h>

#ifdef __SSE2__
#include <emmintrin.h>
#endif

namespace relocd {
namespace {

constexpr float kByte = 255.0F;

std::array<float, 256> MakeLinearTable() {
  std::array<float, 256> table{};
  for (std::size_t i = 0; i < table.size(); ++i) {
    const double s = static_cast<double>(i) / 255.0;
    table.at(i) = static_cast<float>(s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4));
  }
  return table;
}

const std::array<float, 256> kLinear = MakeLinearTable();

Eigen::Array4f Unpack(std::uint32_t texel) {
  return {kLinear[texel & 0xFFU],
          kLinear[(texel >> 8U) & 0xFFU],
          kLinear[(texel >> 16U) & 0xFFU],
          static_cast<float>(texel >> 24U) / kByte};
}

/// The four bytes, each in [0, 255].
Eigen::Array4f ToFloats(std::uint32_t texel) {
#ifdef __SSE2__
  const __m128i zero = _mm_setzero_si128();
  const __m128i bytes = _mm_cvtsi32_si128(static_cast<int>(texel));
  const __m128i integers = _mm_unpacklo_epi16(_mm_unpacklo_epi8(bytes, zero), zero);
  Eigen::Array4f floats;
  _mm_storeu_ps(floats.data(), _mm_cvtepi32_ps(integers));
  return floats;
#else
  return {static_cast<float>(texel & 0xFFU),
          static_cast<float>(texel >> 8U & 0xFFU),
          static_cast<float>(texel >> 16U & 0xFFU),
          static_cast<float>(texel >> 24U)};
#endif
}

/// Linear light of sRGB in [0, 1], by a polynomial that is off by less than 0.003 (I. Taylor); the
/// last number, coverage, stays.
Eigen::Array4f Linearize(const Eigen::Array4f& srgb) {
  Eigen::Array4f linear = srgb * (srgb * (srgb * 0.305306011F + 0.682171111F) + 0.012522878F);
  linear[3] = srgb[3];
  return linear;
}

std::uint32_t PackByte(float value) {
  return static_cast<std::uint32_t>(std::lround(std::clamp(value, 0.0F, kByte)));
}

std::uint32_t Pack(const Eigen::Array4f& linear) {
  return PackByte(SrgbFromLinear(linear[0])) | PackByte(SrgbFromLinear(linear[1])) << 8U |
         PackByte(SrgbFromLinear(linear[2])) << 16U | PackByte(linear[3] * kByte) << 24U;
}

/// The mean of four texels, in which colour counts as much as it covers.
std::uint32_t Average(const std::array<std::uint32_t, 4>& texels) {
  Eigen::Array4f sum = Eigen::Array4f::Zero();
  Eigen::Array4f plain = Eigen::Array4f::Zero();
  for (const std::uint32_t texel : texels) {
    Eigen::Array4f value = Unpack(texel);
    plain += value;
    value.head<3>() *= value[3];
    sum += value;
  }
  if (sum[3] > 0.0F) {
    sum.head<3>() /= sum[3];
  } else {
    sum.head<3>() = plain.head<3>() / 4.0F;
  }
  sum[3] /= 4.0F;
  return Pack(sum);
}

}  // namespace

float LinearFromSrgb(std::uint8_t value) {
  return kLinear[value];
}

float SrgbFromLinear(float linear) {
  if (!(linear > 0.0F)) return 0.0F;
  if (linear >= 1.0F) return kByte;
  return kByte *
         (linear <= 0.0031308F ? 12.92F * linear : 1.055F * std::pow(linear, 1.0F / 2.4F) - 0.055F);
}

Result<Texture> Texture::Create(int width, int height, std::span<const std::uint8_t> rgba) {
  const auto is_side = [](int side) {
    return side >= 1 && side <= kMaxSide && std::has_single_bit(static_cast<unsigned>(side));
  };
  if (!is_side(width) || !is_side(height)) {
    return Error{
        ErrorKind::kInvalidInput,
        fmt::format(
            "texture of {} x {}, both must be powers of two up to {}", width, height, kMaxSide)};
  }
  const std::size_t count = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  if (rgba.size() != 4 * count) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("texture of {} x {} has {} bytes, must have {}",
                             width,
                             height,
                             rgba.size(),
                             4 * count)};
  }
  Texture texture;
  Level level{.width = width, .height = height, .texels = std::vector<std::uint32_t>(count)};
  for (std::size_t i = 0; i < count; ++i) {
    level.texels[i] = static_cast<std::uint32_t>(rgba[4 * i]) |
                      static_cast<std::uint32_t>(rgba[4 * i + 1]) << 8U |
                      static_cast<std::uint32_t>(rgba[4 * i + 2]) << 16U |
                      static_cast<std::uint32_t>(rgba[4 * i + 3]) << 24U;
    if (rgba[4 * i + 3] != 255) texture.is_opaque_ = false;
  }
  texture.levels_.push_back(std::move(level));
  while (texture.levels_.back().width > 1 || texture.levels_.back().height > 1) {
    const Level& fine = texture.levels_.back();
    Level coarse{
        .width = std::max(fine.width / 2, 1), .height = std::max(fine.height / 2, 1), .texels = {}};
    const auto at = [&fine](int x, int y) {
      return fine.texels[static_cast<std::size_t>(std::min(y, fine.height - 1) * fine.width +
                                                  std::min(x, fine.width - 1))];
    };
    for (int y = 0; y < coarse.height; ++y) {
      for (int x = 0; x < coarse.width; ++x) {
        coarse.texels.push_back(Average({at(2 * x, 2 * y),
                                         at(2 * x + 1, 2 * y),
                                         at(2 * x, 2 * y + 1),
                                         at(2 * x + 1, 2 * y + 1)}));
      }
    }
    texture.levels_.push_back(std::move(coarse));
  }
  return texture;
}

float Texture::LevelOf(float footprint) const {
  const float texels = footprint * static_cast<float>(width());
  if (!(texels > 1.0F)) return 0.0F;
  return std::min(std::log2(texels), static_cast<float>(levels_.size() - 1));
}

Eigen::Array4f Texture::SampleLevel(const Level& level, float u, float v) {
  const float x = (u - std::floor(u)) * static_cast<float>(level.width) - 0.5F;
  const float y = (v - std::floor(v)) * static_cast<float>(level.height) - 0.5F;
  const float x_floor = std::floor(x);
  const float y_floor = std::floor(y);
  const float fx = x - x_floor;
  const float fy = y - y_floor;
  // Sides are powers of two, so that the mask wraps negative numbers as well.
  const auto x_mask = static_cast<std::uint32_t>(level.width - 1);
  const auto y_mask = static_cast<std::uint32_t>(level.height - 1);
  const auto x0 = static_cast<std::uint32_t>(static_cast<std::int32_t>(x_floor)) & x_mask;
  const auto y0 = static_cast<std::uint32_t>(static_cast<std::int32_t>(y_floor)) & y_mask;
  const std::uint32_t x1 = (x0 + 1U) & x_mask;
  const std::uint32_t y1 = (y0 + 1U) & y_mask;
  const auto stride = static_cast<std::uint32_t>(level.width);
  const std::uint32_t* const texels = level.texels.data();
  return (1.0F - fy) * ((1.0F - fx) * ToFloats(texels[y0 * stride + x0]) +
                        fx * ToFloats(texels[y0 * stride + x1])) +
         fy * ((1.0F - fx) * ToFloats(texels[y1 * stride + x0]) +
               fx * ToFloats(texels[y1 * stride + x1]));
}

float Texture::AlphaNear(const Level& level, float u, float v) {
  const auto x = static_cast<std::uint32_t>((u - std::floor(u)) * static_cast<float>(level.width));
  const auto y = static_cast<std::uint32_t>((v - std::floor(v)) * static_cast<float>(level.height));
  // Rounding may reach the first texel of the next repetition.
  const std::uint32_t column = x & static_cast<std::uint32_t>(level.width - 1);
  const std::uint32_t row = y & static_cast<std::uint32_t>(level.height - 1);
  const std::uint32_t texel = level.texels[row * static_cast<std::uint32_t>(level.width) + column];
  return static_cast<float>(texel >> 24U) / kByte;
}

Eigen::Array4f Texture::Sample(float u, float v, float footprint) const {
  const float level = LevelOf(footprint);
  const auto fine = static_cast<std::size_t>(level);
  const float part = level - static_cast<float>(fine);
  Eigen::Array4f value = SampleLevel(levels_[fine], u, v);
  // Below this part, the coarser level would not be seen.
  constexpr float kLeastPart = 0.04F;
  if (part >= kLeastPart && fine + 1 < levels_.size())
    value += part * (SampleLevel(levels_[fine + 1], u, v) - value);
  return Linearize(value / kByte);
}

float Texture::SampleAlpha(float u, float v, float footprint) const {
  if (is_opaque_) return 1.0F;
  const auto level =
      std::min(static_cast<std::size_t>(LevelOf(footprint) + 0.5F), levels_.size() - 1);
  return AlphaNear(levels_[level], u, v);
}

}  // namespace relocd
