#include "simulation/campus_textures.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace relocd {
namespace {

/// What a pixel of a repeating texture is made from.
struct Texel {
  float u = 0.0F;  ///< In [0, 1).
  float v = 0.0F;
  float grain = 0.0F;  ///< Different for each pixel, in [-1, 1].
};

Texel TexelAt(int x, int y, int side) {
  return {
      (static_cast<float>(x) + 0.5F) / static_cast<float>(side),
      (static_cast<float>(y) + 0.5F) / static_cast<float>(side),
      2.0F * HashedUnit(static_cast<std::uint32_t>(x), static_cast<std::uint32_t>(y), 1U) - 1.0F};
}

Paint Mixed(const Paint& a, const Paint& b, float part) {
  return a + std::clamp(part, 0.0F, 1.0F) * (b - a);
}

/// One stone of a wall or floor in rows: which one, and how far from its edges.
struct Stone {
  std::uint32_t column = 0;
  std::uint32_t row = 0;
  float edge = 0.0F;   ///< To its nearest edge, in the unit of the sizes.
  float along = 0.0F;  ///< In [0, 1).
  float up = 0.0F;
};

/// Rows of stones, each shifted by `shift` of a stone against the one before.
Stone StoneAt(
    float u, float v, const Eigen::Vector2i& count, float shift, const Eigen::Vector2f& size) {
  const float row = std::floor(v * static_cast<float>(count.y()));
  const float across = u * static_cast<float>(count.x()) + shift * row;
  const float column = std::floor(across);
  Stone stone;
  stone.row = static_cast<std::uint32_t>(row);
  stone.column = static_cast<std::uint32_t>(column) % static_cast<std::uint32_t>(count.x());
  stone.along = across - column;
  stone.up = v * static_cast<float>(count.y()) - row;
  const float x = std::min(stone.along, 1.0F - stone.along) * size.x();
  const float y = std::min(stone.up, 1.0F - stone.up) * size.y();
  stone.edge = std::min(x, y);
  return stone;
}

std::uint32_t Salt(CampusRandom& random) {
  return static_cast<std::uint32_t>(random.Bits() >> 40U);
}

}  // namespace

Texture MakeAsphaltTexture(const TileNoise& noise) {
  constexpr int kSide = 1024;
  Canvas canvas(kSide, kSide, GreyPaint(0.4F));
  canvas.Fill([&](int x, int y) {
    const Texel t = TexelAt(x, y, kSide);
    const float coarse = noise.Cloud(t.u, t.v) - 0.5F;
    const float stones = noise.Speckle(t.u, t.v) - 0.5F;
    float grey = 0.385F + 0.12F * coarse + 0.13F * stones + 0.055F * t.grain;
    if (t.grain > 0.955F) grey += 0.2F;
    if (t.grain < -0.965F) grey -= 0.13F;
    return GreyPaint(grey, 0.004F + 0.02F * coarse);
  });
  return canvas.ToTexture();
}

Texture MakePavingTexture(const TileNoise& noise, CampusRandom random) {
  constexpr int kSide = 512;
  const std::uint32_t salt = Salt(random);
  Canvas canvas(kSide, kSide, GreyPaint(0.6F));
  canvas.Fill([&](int x, int y) {
    const Texel t = TexelAt(x, y, kSide);
    const Stone stone = StoneAt(t.u, t.v, {6, 6}, 0.5F, {0.4F, 0.4F});
    const float tint = HashedUnit(stone.column, stone.row, salt) - 0.5F;
    const float cloud = noise.Cloud(2.0F * t.u, 2.0F * t.v) - 0.5F;
    const float fine = noise.Speckle(t.u, t.v) - 0.5F;
    float grey = 0.57F + 0.11F * tint + 0.14F * cloud + 0.08F * fine + 0.03F * t.grain;
    if (stone.edge < 0.006F)
      grey = 0.33F + 0.1F * cloud;
    else if (stone.edge < 0.012F)
      grey -= 0.06F;
    // Old chewing gum.
    if (noise.Speckle(t.u + 0.37F, t.v) > 0.93F) grey -= 0.12F;
    return GreyPaint(grey, 0.012F + 0.015F * tint);
  });
  return canvas.ToTexture();
}

Texture MakeSettsTexture(const TileNoise& noise, CampusRandom random) {
  constexpr int kSide = 512;
  const std::uint32_t salt = Salt(random);
  Canvas canvas(kSide, kSide, GreyPaint(0.5F));
  canvas.Fill([&](int x, int y) {
    const Texel t = TexelAt(x, y, kSide);
    const Stone stone = StoneAt(t.u, t.v, {12, 16}, 0.5F, {0.133F, 0.1F});
    const float tint = HashedUnit(stone.column, stone.row, salt);
    const float cloud = noise.Cloud(4.0F * t.u, 4.0F * t.v) - 0.5F;
    if (stone.edge < 0.007F) return GreyPaint(0.25F + 0.1F * cloud, 0.01F);
    const float round = std::min(stone.edge / 0.03F, 1.0F);
    const float grey = 0.36F + 0.2F * tint + 0.07F * round + 0.12F * cloud + 0.03F * t.grain;
    return GreyPaint(grey, 0.03F * (tint - 0.3F));
  });
  return canvas.ToTexture();
}

Texture MakeGrassTexture(const TileNoise& noise) {
  constexpr int kSide = 512;
  Canvas canvas(kSide, kSide, OpaquePaint(0.35F, 0.42F, 0.22F));
  canvas.Fill([&](int x, int y) {
    const Texel t = TexelAt(x, y, kSide);
    const float dry = noise.Cloud(t.u, t.v);
    const float tufts = noise.Speckle(t.u, t.v) - 0.5F;
    const float light = 1.0F + 0.5F * tufts + 0.22F * t.grain;
    const Paint green = OpaquePaint(0.315F, 0.385F, 0.195F);
    const Paint straw = OpaquePaint(0.47F, 0.45F, 0.285F);
    return Shaded(Mixed(green, straw, 1.8F * (dry - 0.42F)), light);
  });
  return canvas.ToTexture();
}

Texture MakeBrickTexture(const TileNoise& noise,
                         const std::array<Paint, 2>& range,
                         const Paint& mortar,
                         CampusRandom random) {
  constexpr int kSide = 1024;
  const std::uint32_t salt = Salt(random);
  Canvas canvas(kSide, kSide, mortar);
  canvas.Fill([&](int x, int y) {
    const Texel t = TexelAt(x, y, kSide);
    // 0.24 m x 0.08 m with their joints.
    const Stone stone = StoneAt(t.u, t.v, {16, 48}, 0.5F, {0.24F, 0.08F});
    const float tint = HashedUnit(stone.column, stone.row, salt);
    const float shade = HashedUnit(stone.column, stone.row, salt + 1U);
    const float cloud = noise.Cloud(t.u, t.v) - 0.5F;
    const float fine = noise.Speckle(t.u, t.v) - 0.5F;
    if (stone.edge < 0.0058F + 0.003F * fine)
      return Shaded(mortar, 1.0F + 0.3F * cloud + 0.05F * t.grain);
    float light = 0.86F + 0.28F * shade + 0.25F * cloud + 0.2F * fine + 0.05F * t.grain;
    if (shade > 0.95F) light *= 0.68F;
    if (stone.edge < 0.010F) light *= 0.93F;
    return Shaded(Mixed(range[0], range[1], tint), light);
  });
  return canvas.ToTexture();
}

Texture MakePlasterTexture(const TileNoise& noise) {
  constexpr int kSide = 512;
  Canvas canvas(kSide, kSide, GreyPaint(0.85F));
  canvas.Fill([&](int x, int y) {
    const Texel t = TexelAt(x, y, kSide);
    const float cloud = noise.Cloud(t.u, t.v) - 0.5F;
    const float rough = noise.Speckle(t.u, t.v) - 0.5F;
    // Streaks that run down.
    const float streaks = noise.Cloud(8.0F * t.u, t.v + 0.6F) - 0.5F;
    const float grey = 0.88F + 0.10F * cloud + 0.07F * rough + 0.06F * streaks + 0.025F * t.grain;
    return GreyPaint(grey, 0.008F);
  });
  return canvas.ToTexture();
}

Texture MakeClapboardTexture(const TileNoise& noise, CampusRandom random) {
  constexpr int kSide = 512;
  const std::uint32_t salt = Salt(random);
  Canvas canvas(kSide, kSide, GreyPaint(0.85F));
  canvas.Fill([&](int x, int y) {
    const Texel t = TexelAt(x, y, kSide);
    const Stone board = StoneAt(t.u, t.v, {1, 16}, 0.37F, {2.4F, 0.15F});
    const float tint = HashedUnit(board.column, board.row, salt) - 0.5F;
    const float wood = noise.Cloud(2.0F * t.u, 24.0F * t.v) - 0.5F;
    const float cloud = noise.Cloud(t.u, t.v) - 0.5F;
    float grey = 0.84F + 0.06F * tint + 0.07F * wood + 0.12F * cloud + 0.02F * t.grain;
    // The shadow under the lap of the board above.
    if (board.up < 0.13F) grey *= 0.55F + 2.5F * board.up;
    if (board.edge < 0.004F) grey *= 0.75F;
    return GreyPaint(grey, 0.006F);
  });
  return canvas.ToTexture();
}

Texture MakeRoofTileTexture(const TileNoise& noise, CampusRandom random) {
  constexpr int kSide = 512;
  const std::uint32_t salt = Salt(random);
  Canvas canvas(kSide, kSide, OpaquePaint(0.5F, 0.3F, 0.22F));
  canvas.Fill([&](int x, int y) {
    const Texel t = TexelAt(x, y, kSide);
    const Stone tile = StoneAt(t.u, t.v, {12, 10}, 0.0F, {0.25F, 0.3F});
    const float tint = HashedUnit(tile.column, tile.row, salt);
    const float moss = noise.Cloud(2.0F * t.u, 2.0F * t.v);
    float light = 0.8F + 0.3F * tint + 0.05F * t.grain;
    light *= 0.72F + 0.34F * std::sin(3.14159F * tile.along);
    if (tile.up > 0.9F) light *= 0.5F;
    const Paint clay = OpaquePaint(0.53F, 0.345F, 0.27F);
    const Paint dark = OpaquePaint(0.36F, 0.33F, 0.26F);
    return Shaded(Mixed(clay, dark, 2.2F * (moss - 0.5F)), light);
  });
  return canvas.ToTexture();
}

Texture MakeSlateTexture(const TileNoise& noise, CampusRandom random) {
  constexpr int kSide = 512;
  const std::uint32_t salt = Salt(random);
  Canvas canvas(kSide, kSide, GreyPaint(0.35F));
  canvas.Fill([&](int x, int y) {
    const Texel t = TexelAt(x, y, kSide);
    const Stone tile = StoneAt(t.u, t.v, {12, 16}, 0.5F, {0.25F, 0.19F});
    const float tint = HashedUnit(tile.column, tile.row, salt) - 0.5F;
    const float moss = noise.Cloud(2.0F * t.u, 2.0F * t.v) - 0.5F;
    float grey = 0.37F + 0.13F * tint + 0.16F * moss + 0.03F * t.grain;
    if (tile.edge < 0.008F || tile.up > 0.93F) grey *= 0.6F;
    return GreyPaint(grey, -0.012F + 0.04F * moss);
  });
  return canvas.ToTexture();
}

Texture MakeConcreteTexture(const TileNoise& noise) {
  constexpr int kSide = 512;
  Canvas canvas(kSide, kSide, GreyPaint(0.6F));
  canvas.Fill([&](int x, int y) {
    const Texel t = TexelAt(x, y, kSide);
    const Stone panel = StoneAt(t.u, t.v, {2, 2}, 0.0F, {1.8F, 1.8F});
    const float cloud = noise.Cloud(t.u, t.v) - 0.5F;
    const float fine = noise.Speckle(t.u, t.v) - 0.5F;
    float grey = 0.63F + 0.16F * cloud + 0.08F * fine + 0.025F * t.grain;
    if (panel.edge < 0.012F) grey *= 0.6F;
    const float x_hole = std::abs(std::abs(panel.along - 0.5F) - 0.3F) * 1.8F;
    const float y_hole = std::abs(std::abs(panel.up - 0.5F) - 0.3F) * 1.8F;
    if (std::hypot(x_hole, y_hole) < 0.022F) grey *= 0.6F;
    return GreyPaint(grey, 0.008F);
  });
  return canvas.ToTexture();
}

Texture MakePlankTexture(const TileNoise& noise, CampusRandom random) {
  constexpr int kSide = 256;
  const std::uint32_t salt = Salt(random);
  Canvas canvas(kSide, kSide, GreyPaint(0.6F));
  canvas.Fill([&](int x, int y) {
    const Texel t = TexelAt(x, y, kSide);
    const Stone plank = StoneAt(t.v, t.u, {1, 12}, 0.3F, {1.6F, 0.133F});
    const float tint = HashedUnit(plank.column, plank.row, salt) - 0.5F;
    const float wood = noise.Cloud(12.0F * t.u, t.v) - 0.5F;
    float grey = 0.68F + 0.2F * tint + 0.3F * wood + 0.04F * t.grain;
    if (plank.edge < 0.008F) grey *= 0.4F;
    return GreyPaint(grey, 0.025F);
  });
  return canvas.ToTexture();
}

Texture MakeMetalTexture(const TileNoise& noise) {
  constexpr int kSide = 256;
  Canvas canvas(kSide, kSide, GreyPaint(0.8F));
  canvas.Fill([&](int x, int y) {
    const Texel t = TexelAt(x, y, kSide);
    const float cloud = noise.Cloud(2.0F * t.u, 2.0F * t.v) - 0.5F;
    const float rust = noise.Cloud(3.0F * t.u + 0.2F, 3.0F * t.v);
    const Paint paint = GreyPaint(0.82F + 0.14F * cloud + 0.03F * t.grain);
    return Mixed(paint, OpaquePaint(0.45F, 0.32F, 0.22F), 9.0F * (rust - 0.72F));
  });
  return canvas.ToTexture();
}

Texture MakeBarkTexture(const TileNoise& noise) {
  constexpr int kSide = 256;
  Canvas canvas(kSide, kSide, GreyPaint(0.4F));
  canvas.Fill([&](int x, int y) {
    const Texel t = TexelAt(x, y, kSide);
    const float ridges = noise.Cloud(5.0F * t.u, t.v) - 0.5F;
    const float patches = noise.Cloud(2.0F * t.u, 2.0F * t.v) - 0.5F;
    const float grey = 0.37F + 0.4F * ridges + 0.2F * patches + 0.04F * t.grain;
    return GreyPaint(grey, 0.025F);
  });
  return canvas.ToTexture();
}

Texture MakeForestTexture(const TileNoise& noise) {
  constexpr int kSide = 256;
  Canvas canvas(kSide, kSide, OpaquePaint(0.25F, 0.32F, 0.2F));
  canvas.Fill([&](int x, int y) {
    const Texel t = TexelAt(x, y, kSide);
    const float crowns = noise.Cloud(3.0F * t.u, 3.0F * t.v) - 0.5F;
    const float kind = noise.Cloud(t.u, t.v);
    const Paint paint = Mixed(
        OpaquePaint(0.23F, 0.30F, 0.19F), OpaquePaint(0.36F, 0.38F, 0.22F), 2.0F * (kind - 0.4F));
    return Shaded(paint, 1.0F + 1.4F * crowns + 0.1F * t.grain);
  });
  return canvas.ToTexture();
}

Texture MakeRoadPaintTexture(const TileNoise& noise) {
  constexpr int kSide = 512;
  Canvas canvas(kSide, kSide, GreyPaint(0.85F));
  canvas.Fill([&](int x, int y) {
    const Texel t = TexelAt(x, y, kSide);
    const float worn = 0.5F * (noise.Cloud(t.u, t.v) + noise.Speckle(t.u, t.v));
    const float dirt = noise.Cloud(t.u, t.v) - 0.5F;
    Paint paint = GreyPaint(0.80F + 0.2F * dirt + 0.05F * t.grain, 0.008F);
    paint[3] = worn + 0.04F * t.grain > 0.63F ? 0.0F : 1.0F;
    return paint;
  });
  return canvas.ToTexture();
}

}  // namespace relocd
