#pragma once

#include "rendering/mesh_builder.h"
#include "rendering/texture.h"
#include "simulation/campus_canvas.h"
#include "simulation/campus_random.h"

namespace relocd {

/// How many pictures a texture holds, in rows from above.
struct PictureGrid {
  int columns = 1;
  int rows = 1;

  [[nodiscard]] int size() const { return columns * rows; }
  [[nodiscard]] PicturePart Part(std::size_t index) const;
};

inline constexpr PictureGrid kWindowPictures{4, 2};
inline constexpr PictureGrid kShopPictures{2, 4};
/// The last one is a university's.
inline constexpr PictureGrid kShopSigns{2, 12};
inline constexpr PictureGrid kPosters{4, 4};
inline constexpr PictureGrid kDoorPictures{4, 2};
/// Eight traffic signs (see TrafficSign), eight house numbers.
inline constexpr PictureGrid kPlates{4, 4};
/// A manhole, a drain, an oil stain, a patch's outline.
inline constexpr PictureGrid kRoadDetails{2, 2};

inline constexpr PictureGrid kLicencePlates{2, 8};

enum class TrafficSign {
  kStop,
  kGiveWay,
  kLimit30,
  kParking,
  kNoEntry,
  kDeadEnd,
  kCrossing,
  kPriority
};

Texture MakeWindowPictures(const TileNoise& noise, CampusRandom random);
Texture MakeShopPictures(const TileNoise& noise, CampusRandom random);
Texture MakeShopSigns(const TileNoise& noise, CampusRandom random);
Texture MakePosters(const TileNoise& noise, CampusRandom random);
Texture MakeDoorPictures(const TileNoise& noise, CampusRandom random);
Texture MakePlates(CampusRandom random);
Texture MakeLicencePlates(CampusRandom random);
Texture MakeRoadDetails(const TileNoise& noise);
Texture MakeCracks(CampusRandom random);
/// Dirt that runs down a wall.
Texture MakeStains(const TileNoise& noise);

/// A twig with leaves of the given length (in parts of the picture) between two colours.
Texture MakeLeaves(
    float leaf_length, float slimness, const Paint& dark, const Paint& light, CampusRandom random);
Texture MakeGrassTuft(CampusRandom random);

}  // namespace relocd
