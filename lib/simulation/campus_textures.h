#pragma once

#include <array>

#include "rendering/texture.h"
#include "simulation/campus_canvas.h"
#include "simulation/campus_random.h"

namespace relocd {

/// Textures of surfaces that repeat, made from noise. What a repetition covers is the `kTile...`
/// of the same name, m.
inline constexpr float kTileAsphalt = 5.0F;
inline constexpr float kTilePaving = 2.4F;
inline constexpr float kTileSetts = 1.6F;
inline constexpr float kTileGrass = 4.0F;
inline constexpr float kTileBrick = 3.84F;
inline constexpr float kTilePlaster = 4.0F;
inline constexpr float kTileBoards = 2.4F;
inline constexpr float kTileRoof = 3.0F;
inline constexpr float kTileConcrete = 3.6F;
inline constexpr float kTilePlanks = 1.6F;

Texture MakeAsphaltTexture(const TileNoise& noise);
Texture MakePavingTexture(const TileNoise& noise, CampusRandom random);
Texture MakeSettsTexture(const TileNoise& noise, CampusRandom random);
Texture MakeGrassTexture(const TileNoise& noise);
/// Bricks whose colours lie between two paints.
Texture MakeBrickTexture(const TileNoise& noise,
                         const std::array<Paint, 2>& range,
                         const Paint& mortar,
                         CampusRandom random);
Texture MakePlasterTexture(const TileNoise& noise);
Texture MakeClapboardTexture(const TileNoise& noise, CampusRandom random);
Texture MakeRoofTileTexture(const TileNoise& noise, CampusRandom random);
Texture MakeSlateTexture(const TileNoise& noise, CampusRandom random);
Texture MakeConcreteTexture(const TileNoise& noise);
Texture MakePlankTexture(const TileNoise& noise, CampusRandom random);
Texture MakeMetalTexture(const TileNoise& noise);
Texture MakeBarkTexture(const TileNoise& noise);
Texture MakeForestTexture(const TileNoise& noise);
/// White paint that is worn off in places.
Texture MakeRoadPaintTexture(const TileNoise& noise);

}  // namespace relocd
