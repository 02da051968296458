#include "simulation/campus_pictures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <string>
#include <string_view>
#include <vector>

#include "simulation/campus_lettering.h"

namespace relocd {
namespace {

using Eigen::Vector2f;

/// The pixels of one picture of a grid.
struct Area {
  Vector2f low;
  Vector2f size;

  /// A point by parts of the width and height, from the upper left corner.
  [[nodiscard]] Vector2f At(float x, float y) const {
    return low + Vector2f(x * size.x(), y * size.y());
  }
};

Area AreaOf(const Canvas& canvas, const PictureGrid& grid, int index) {
  const Vector2f size(static_cast<float>(canvas.width()) / static_cast<float>(grid.columns),
                      static_cast<float>(canvas.height()) / static_cast<float>(grid.rows));
  return {{static_cast<float>(index % grid.columns) * size.x(),
           static_cast<float>(index / grid.columns) * size.y()},
          size};
}

void FillArea(Canvas& canvas, const Area& area, const Paint& paint) {
  canvas.FillRectangle(area.low, area.low + area.size, paint);
}

Paint MutedPaint(CampusRandom& random) {
  const float grey = random.Uniform(0.25F, 0.75F);
  const float r = grey + random.Uniform(-0.14F, 0.16F);
  const float g = grey + random.Uniform(-0.10F, 0.08F);
  const float b = grey + random.Uniform(-0.14F, 0.12F);
  return OpaquePaint(r, g, b);
}

/// Brightness varies a little over everything, as dust does.
void AddDust(Canvas& canvas, const TileNoise& noise, float amount) {
  for (int y = 0; y < canvas.height(); ++y) {
    for (int x = 0; x < canvas.width(); ++x) {
      const float u = static_cast<float>(x) / static_cast<float>(canvas.width());
      const float v = static_cast<float>(y) / static_cast<float>(canvas.height());
      Paint& pixel = canvas.At(x, y);
      pixel.head<3>() *= 1.0F + amount * (noise.Cloud(3.0F * u, 3.0F * v) - 0.5F);
    }
  }
}

void DrawCurtains(Canvas& canvas, const Area& area, float width, const Paint& paint) {
  constexpr int kFolds = 14;
  for (int i = 0; i < kFolds; ++i) {
    const float from = static_cast<float>(i) / kFolds;
    const Paint fold = Shaded(paint, i % 2 == 0 ? 1.0F : 0.82F);
    const float x = width * from;
    const float next = width * (from + 1.0F / kFolds);
    canvas.FillRectangle(area.At(x, 0.0F), area.At(next, 1.0F), fold);
    canvas.FillRectangle(area.At(1.0F - next, 0.0F), area.At(1.0F - x, 1.0F), fold);
  }
}

void DrawBlinds(Canvas& canvas, const Area& area, float drop, const Paint& paint) {
  constexpr float kSlat = 0.028F;
  for (float y = 0.0F; y < drop; y += kSlat) {
    canvas.FillRectangle(area.At(0.0F, y), area.At(1.0F, y + 0.7F * kSlat), paint);
    canvas.FillRectangle(
        area.At(0.0F, y + 0.7F * kSlat), area.At(1.0F, y + kSlat), Shaded(paint, 0.5F));
  }
}

void DrawPlant(Canvas& canvas, const Area& area, float x, CampusRandom& random) {
  canvas.FillRectangle(
      area.At(x - 0.09F, 0.86F), area.At(x + 0.09F, 1.0F), OpaquePaint(0.5F, 0.33F, 0.25F));
  for (int i = 0; i < 26; ++i) {
    const float dx = random.Uniform(-0.2F, 0.2F);
    const float y = random.Uniform(0.58F, 0.88F);
    const float light = random.Uniform(0.6F, 1.2F);
    const float angle = random.Uniform(0.0F, 3.1F);
    canvas.FillEllipse(area.At(x + dx, y),
                       {0.09F * area.size.x(), 0.03F * area.size.x()},
                       angle,
                       Shaded(OpaquePaint(0.26F, 0.35F, 0.2F), light));
  }
}

void DrawShelves(Canvas& canvas, const Area& area, CampusRandom& random) {
  for (const float y : {0.34F, 0.58F, 0.82F}) {
    canvas.FillRectangle(area.At(0.1F, y), area.At(0.9F, y + 0.02F), GreyPaint(0.35F, 0.04F));
    for (float x = 0.12F; x < 0.86F;) {
      const float width = random.Uniform(0.03F, 0.08F);
      const float height = random.Uniform(0.08F, 0.2F);
      if (random.Chance(0.85))
        canvas.FillRectangle(
            area.At(x, y - height), area.At(x + width, y), Shaded(MutedPaint(random), 0.75F));
      x += width + 0.005F;
    }
  }
}

void DrawWindow(Canvas& canvas, const Area& area, int kind, CampusRandom& random) {
  FillArea(canvas, area, GreyPaint(0.17F, 0.006F));
  canvas.FillRectangle(area.At(0.0F, 0.0F), area.At(1.0F, 0.3F), GreyPaint(0.13F, 0.0F));
  // A lit doorway or lamp far inside.
  canvas.FillRectangle(area.At(0.52F, 0.42F), area.At(0.74F, 1.0F), GreyPaint(0.23F, 0.02F));
  const Paint cloth = GreyPaint(random.Uniform(0.62F, 0.82F), random.Uniform(-0.01F, 0.05F));
  switch (kind) {
    case 0:
      break;
    case 1:
      DrawCurtains(canvas, area, 0.26F, cloth);
      break;
    case 2:
      DrawBlinds(canvas, area, random.Uniform(0.45F, 0.7F), cloth);
      break;
    case 3:
      DrawPlant(canvas, area, 0.3F, random);
      DrawPlant(canvas, area, 0.72F, random);
      break;
    case 4:
      DrawShelves(canvas, area, random);
      break;
    case 5:
      DrawCurtains(canvas, area, 0.5F, Shaded(cloth, 0.95F));
      break;
    case 6:
      DrawCurtains(canvas, area, 0.16F, Shaded(MutedPaint(random), 1.1F));
      DrawPlant(canvas, area, 0.5F, random);
      break;
    default:
      DrawBlinds(canvas, area, 1.0F, Shaded(cloth, 0.9F));
  }
}

void DrawGoods(Canvas& canvas, const Area& area, CampusRandom& random) {
  const int kind = static_cast<int>(random.Index(3));
  for (const float y : {0.52F, 0.78F, 0.97F}) {
    canvas.FillRectangle(area.At(0.02F, y), area.At(0.98F, y + 0.025F), GreyPaint(0.55F, 0.03F));
    for (float x = 0.04F; x < 0.92F;) {
      const float width = random.Uniform(0.025F, kind == 0 ? 0.05F : 0.1F);
      const float height = random.Uniform(0.07F, 0.19F);
      const Paint paint = MutedPaint(random);
      if (kind == 1) {
        canvas.FillEllipse(area.At(x + 0.5F * width, y - 0.5F * height),
                           {0.45F * width * area.size.x(), 0.5F * height * area.size.y()},
                           0.0F,
                           paint);
      } else {
        canvas.FillRectangle(area.At(x, y - height), area.At(x + width, y), paint);
        canvas.FillRectangle(area.At(x + 0.2F * width, y - 0.7F * height),
                             area.At(x + 0.8F * width, y - 0.4F * height),
                             Shaded(paint, 1.4F));
      }
      x += width + random.Uniform(0.004F, 0.03F);
    }
  }
}

void DrawShop(Canvas& canvas, const Area& area, std::string_view slogan, CampusRandom& random) {
  FillArea(canvas, area, GreyPaint(random.Uniform(0.24F, 0.36F), 0.025F));
  for (int i = 0; i < 5; ++i) {
    const float x = 0.1F + 0.2F * static_cast<float>(i);
    canvas.FillEllipse(area.At(x, 0.08F), {9.0F, 4.0F}, 0.0F, OpaquePaint(0.85F, 0.8F, 0.66F));
  }
  DrawGoods(canvas, area, random);
  const Paint ink = random.Chance(0.6) ? GreyPaint(0.88F) : OpaquePaint(0.72F, 0.3F, 0.22F);
  DrawTextWithin(slogan,
                 area.At(0.08F, 0.14F),
                 area.At(0.92F, 0.30F),
                 {.height = 36.0F, .stroke = 5.0F, .slant = 0.15F, .paint = ink},
                 canvas);
  const float x = random.Uniform(0.05F, 0.7F);
  canvas.FillRectangle(area.At(x, 0.34F), area.At(x + 0.16F, 0.66F), GreyPaint(0.84F, 0.03F));
  DrawTextWithin("-50",
                 area.At(x + 0.02F, 0.38F),
                 area.At(x + 0.14F, 0.58F),
                 {.height = 40.0F, .stroke = 6.0F, .paint = OpaquePaint(0.68F, 0.18F, 0.15F)},
                 canvas);
}

std::string DrawName(int kind, CampusRandom& random) {
  if (kind + 1 == kShopSigns.size()) return "UNIVERSITY";
  constexpr std::array<std::string_view, 14> kOwners{"MILLER",
                                                     "ROSA'S",
                                                     "WINTER",
                                                     "HAND & SON",
                                                     "KOVAC",
                                                     "ADLER",
                                                     "NORDEN",
                                                     "PETIT",
                                                     "OLIVA",
                                                     "BRANDT",
                                                     "MARLOW",
                                                     "SUNDBY",
                                                     "FERRARO",
                                                     "LINDE"};
  constexpr std::array<std::string_view, 12> kTrades{"BAKERY",
                                                     "BOOKS",
                                                     "PHARMACY",
                                                     "CAFE",
                                                     "BICYCLES",
                                                     "FLOWERS",
                                                     "OPTICIAN",
                                                     "BANK",
                                                     "HAIR & CO",
                                                     "TEA ROOM",
                                                     "COPY SHOP",
                                                     "HARDWARE"};
  const std::string owner(random.Pick(kOwners));
  const std::string trade(kTrades.at(static_cast<std::size_t>(kind) % kTrades.size()));
  return random.Chance(0.6) ? owner + " " + trade : trade;
}

void DrawPoster(Canvas& canvas, const Area& area, CampusRandom& random) {
  constexpr std::array<std::string_view, 8> kWords{
      "CONCERT", "OPEN DAY", "THEATRE", "FAIR", "JAZZ", "LECTURE", "MARKET", "CINEMA"};
  const Paint ground = MutedPaint(random);
  const Paint ink = ground[1] > 0.5F ? GreyPaint(0.13F) : GreyPaint(0.9F);
  FillArea(canvas, area, ground);
  for (int i = 0; i < 4; ++i) {
    const Vector2f centre = {random.Uniform(0.15F, 0.85F), random.Uniform(0.15F, 0.6F)};
    const Vector2f radii = {random.Uniform(6.0F, 34.0F), random.Uniform(6.0F, 34.0F)};
    canvas.FillEllipse(
        area.At(centre.x(), centre.y()), radii, random.Uniform(0.0F, 3.0F), MutedPaint(random));
  }
  DrawTextWithin(random.Pick(kWords),
                 area.At(0.08F, 0.62F),
                 area.At(0.92F, 0.8F),
                 {.height = 22.0F, .stroke = 4.0F, .paint = ink},
                 canvas);
  for (const float y : {0.84F, 0.89F, 0.94F})
    canvas.FillRectangle(area.At(0.1F, y), area.At(random.Uniform(0.5F, 0.9F), y + 0.02F), ink);
  canvas.DrawFrame(area.low, area.low + area.size, 2.0F, GreyPaint(0.8F));
}

void DrawDoor(Canvas& canvas, const Area& area, int kind, CampusRandom& random) {
  Paint paint = Shaded(MutedPaint(random), 0.75F);
  FillArea(canvas, area, paint);
  canvas.DrawFrame(area.low, area.low + area.size, 5.0F, Shaded(paint, 0.7F));
  const auto panel = [&](const Vector2f& low, const Vector2f& high, bool is_glass) {
    const Vector2f a = area.At(low.x(), low.y());
    const Vector2f b = area.At(high.x(), high.y());
    canvas.FillRectangle(a, b, is_glass ? GreyPaint(0.2F) : Shaded(paint, 0.9F));
    canvas.DrawFrame(a, b, 3.0F, Shaded(paint, 0.62F));
    canvas.DrawStroke({a.x(), b.y()}, b, 2.0F, Shaded(paint, 1.3F));
  };
  if (kind % 4 == 0) {
    panel({0.14F, 0.08F}, {0.86F, 0.42F}, true);
    panel({0.14F, 0.5F}, {0.86F, 0.92F}, false);
  } else if (kind % 4 == 1) {
    for (const float x : {0.12F, 0.54F}) {
      panel({x, 0.06F}, {x + 0.34F, 0.22F}, true);
      panel({x, 0.28F}, {x + 0.34F, 0.56F}, false);
      panel({x, 0.62F}, {x + 0.34F, 0.93F}, false);
    }
  } else if (kind % 4 == 2) {
    panel({0.1F, 0.06F}, {0.9F, 0.88F}, true);
  } else {
    for (int i = 0; i < 8; ++i)
      canvas.DrawStroke(area.At(0.125F * static_cast<float>(i), 0.0F),
                        area.At(0.125F * static_cast<float>(i), 1.0F),
                        2.0F,
                        Shaded(paint, 0.6F));
    panel({0.36F, 0.12F}, {0.64F, 0.3F}, true);
  }
  canvas.FillRectangle(area.At(0.06F, 0.48F), area.At(0.1F, 0.56F), GreyPaint(0.75F, 0.04F));
  canvas.FillRectangle(area.At(0.35F, 0.45F), area.At(0.65F, 0.475F), GreyPaint(0.6F, 0.05F));
}

void FillTriangle(Canvas& canvas, const Area& area, float margin, const Paint& paint) {
  for (float y = margin; y < 1.0F - 1.6F * margin; y += 0.006F) {
    const float half = 0.5F * (1.0F - margin - y) - 0.6F * margin;
    if (half > 0.0F)
      canvas.DrawStroke(area.At(0.5F - half, y), area.At(0.5F + half, y), 2.0F, paint);
  }
}

/// A blue square with a white rim, and what is on it.
void DrawInformationSign(Canvas& canvas, const Area& area, TrafficSign sign) {
  const Paint white = GreyPaint(0.9F);
  canvas.FillRectangle(
      area.At(0.04F, 0.04F), area.At(0.96F, 0.96F), OpaquePaint(0.16F, 0.28F, 0.55F));
  canvas.DrawFrame(area.At(0.06F, 0.06F), area.At(0.94F, 0.94F), 3.0F, white);
  if (sign == TrafficSign::kParking) {
    const Lettering letters{.height = 70.0F, .stroke = 12.0F, .paint = white};
    DrawTextWithin("P", area.At(0.12F, 0.3F), area.At(0.88F, 0.7F), letters, canvas);
  } else if (sign == TrafficSign::kDeadEnd) {
    canvas.FillRectangle(area.At(0.42F, 0.3F), area.At(0.58F, 0.9F), white);
    canvas.FillRectangle(
        area.At(0.22F, 0.16F), area.At(0.78F, 0.3F), OpaquePaint(0.66F, 0.15F, 0.14F));
  } else {
    for (const float x : {0.2F, 0.4F, 0.6F, 0.8F})
      canvas.DrawStroke(area.At(x, 0.75F), area.At(0.5F + 0.7F * (x - 0.5F), 0.6F), 6.0F, white);
    canvas.FillEllipse(area.At(0.5F, 0.2F), {8.0F, 8.0F}, 0.0F, white);
    canvas.DrawStroke(area.At(0.5F, 0.28F), area.At(0.48F, 0.48F), 9.0F, white);
    canvas.DrawStroke(area.At(0.48F, 0.48F), area.At(0.36F, 0.68F), 6.0F, white);
    canvas.DrawStroke(area.At(0.48F, 0.48F), area.At(0.62F, 0.68F), 6.0F, white);
  }
}

void DrawTrafficSign(Canvas& canvas, const Area& area, TrafficSign sign) {
  const Paint red = OpaquePaint(0.66F, 0.15F, 0.14F);
  const Paint white = GreyPaint(0.9F);
  const auto disc = [&](float radius, const Paint& paint) {
    const float pixels = radius * area.size.x();
    canvas.FillEllipse(area.At(0.5F, 0.5F), {pixels, pixels}, 0.0F, paint);
  };
  const auto text = [&](std::string_view word, float height, const Paint& paint) {
    const Lettering letters{.height = height, .stroke = 0.17F * height, .paint = paint};
    DrawTextWithin(word, area.At(0.12F, 0.3F), area.At(0.88F, 0.7F), letters, canvas);
  };
  switch (sign) {
    case TrafficSign::kStop:
      disc(0.48F, white);
      disc(0.45F, red);
      text("STOP", 34.0F, white);
      break;
    case TrafficSign::kGiveWay:
      FillTriangle(canvas, area, 0.01F, red);
      FillTriangle(canvas, area, 0.11F, white);
      break;
    case TrafficSign::kLimit30:
      disc(0.48F, red);
      disc(0.38F, white);
      text("30", 50.0F, GreyPaint(0.1F));
      break;
    case TrafficSign::kNoEntry:
      disc(0.48F, red);
      canvas.FillRectangle(area.At(0.2F, 0.42F), area.At(0.8F, 0.58F), white);
      break;
    case TrafficSign::kPriority:
      canvas.DrawStroke(area.At(0.5F, 0.3F), area.At(0.5F, 0.7F), 40.0F, white);
      disc(0.24F, OpaquePaint(0.8F, 0.66F, 0.15F));
      break;
    default:
      DrawInformationSign(canvas, area, sign);
  }
}

void DrawManhole(Canvas& canvas, const Area& area) {
  const float side = area.size.x();
  const auto disc = [&](float radius, float grey) {
    canvas.FillEllipse(
        area.At(0.5F, 0.5F), {radius * side, radius * side}, 0.0F, GreyPaint(grey, 0.01F));
  };
  disc(0.48F, 0.30F);
  disc(0.43F, 0.17F);
  disc(0.41F, 0.36F);
  for (int y = 0; y < 9; ++y) {
    for (int x = 0; x < 9; ++x) {
      const Vector2f p(0.1F + 0.1F * static_cast<float>(x), 0.1F + 0.1F * static_cast<float>(y));
      if ((p - Vector2f(0.5F, 0.5F)).norm() < 0.36F)
        canvas.FillRectangle(area.At(p.x() - 0.03F, p.y() - 0.03F),
                             area.At(p.x() + 0.03F, p.y() + 0.03F),
                             GreyPaint((x + y) % 2 == 0 ? 0.5F : 0.25F, 0.01F));
    }
  }
}

void DrawDrain(Canvas& canvas, const Area& area) {
  FillArea(canvas, area, GreyPaint(0.33F, 0.01F));
  for (int i = 0; i < 8; ++i) {
    const float x = 0.09F + 0.11F * static_cast<float>(i);
    canvas.FillRectangle(area.At(x, 0.08F), area.At(x + 0.05F, 0.46F), GreyPaint(0.04F));
    canvas.FillRectangle(area.At(x, 0.54F), area.At(x + 0.05F, 0.92F), GreyPaint(0.04F));
  }
  canvas.DrawFrame(area.low, area.low + area.size, 4.0F, GreyPaint(0.22F, 0.01F));
}

/// Where a blot's coverage ends is left to noise.
void DrawBlot(Canvas& canvas, const Area& area, const TileNoise& noise, const Paint& paint) {
  for (float y = 0.0F; y < area.size.y(); y += 1.0F) {
    for (float x = 0.0F; x < area.size.x(); x += 1.0F) {
      const Vector2f p(x / area.size.x() - 0.5F, y / area.size.y() - 0.5F);
      const float cloud = noise.Cloud(p.x(), p.y()) - 0.5F;
      const float fine = noise.Cloud(4.0F * p.x(), 4.0F * p.y()) - 0.5F;
      if (p.norm() + 0.5F * cloud + 0.45F * fine > 0.34F) continue;
      canvas.At(static_cast<int>(area.low.x() + x), static_cast<int>(area.low.y() + y)) =
          Shaded(paint, 1.0F + 0.6F * fine);
    }
  }
}

}  // namespace

PicturePart PictureGrid::Part(std::size_t index) const {
  const auto i = static_cast<int>(index % static_cast<std::size_t>(size()));
  const Vector2f cell(1.0F / static_cast<float>(columns), 1.0F / static_cast<float>(rows));
  const Vector2f low(static_cast<float>(i % columns) * cell.x(),
                     static_cast<float>(rows - 1 - i / columns) * cell.y());
  // A little less, so that neighbours do not show at the rim.
  const Vector2f rim = 0.006F * cell;
  return {low + rim, low + cell - rim};
}

Texture MakeWindowPictures(const TileNoise& noise, CampusRandom random) {
  Canvas canvas(512, 512, GreyPaint(0.2F));
  for (int i = 0; i < kWindowPictures.size(); ++i)
    DrawWindow(canvas, AreaOf(canvas, kWindowPictures, i), i, random);
  AddDust(canvas, noise, 0.25F);
  return canvas.ToTexture();
}

Texture MakeShopPictures(const TileNoise& noise, CampusRandom random) {
  constexpr std::array<std::string_view, 8> kSlogans{"FRESH DAILY",
                                                     "SALE",
                                                     "OPEN 8-18",
                                                     "NEW IN",
                                                     "BEST OF TOWN",
                                                     "SINCE 1968",
                                                     "COFFEE TO GO",
                                                     "WELCOME"};
  Canvas canvas(1024, 1024, GreyPaint(0.3F));
  for (int i = 0; i < kShopPictures.size(); ++i)
    DrawShop(
        canvas, AreaOf(canvas, kShopPictures, i), kSlogans.at(static_cast<std::size_t>(i)), random);
  AddDust(canvas, noise, 0.2F);
  return canvas.ToTexture();
}

Texture MakeShopSigns(const TileNoise& noise, CampusRandom random) {
  Canvas canvas(1024, 1024, GreyPaint(0.3F));
  for (int i = 0; i < kShopSigns.size(); ++i) {
    const Area area = AreaOf(canvas, kShopSigns, i);
    const Paint ground = Shaded(MutedPaint(random), random.Uniform(0.5F, 1.2F));
    const Paint ink = ground[1] > 0.45F ? GreyPaint(0.12F, 0.01F) : GreyPaint(0.9F, 0.03F);
    FillArea(canvas, area, ground);
    canvas.DrawFrame(area.low, area.low + area.size, 4.0F, Shaded(ground, 0.6F));
    const float slant = random.Chance(0.4) ? 0.2F : 0.0F;
    const float stroke = random.Uniform(6.0F, 10.0F);
    DrawTextWithin(
        DrawName(i, random),
        area.At(0.05F, 0.15F),
        area.At(0.95F, 0.85F),
        {.height = random.Uniform(38.0F, 54.0F), .stroke = stroke, .slant = slant, .paint = ink},
        canvas);
  }
  AddDust(canvas, noise, 0.2F);
  return canvas.ToTexture();
}

Texture MakePosters(const TileNoise& noise, CampusRandom random) {
  Canvas canvas(512, 512, GreyPaint(0.7F));
  for (int i = 0; i < kPosters.size(); ++i)
    DrawPoster(canvas, AreaOf(canvas, kPosters, i), random);
  AddDust(canvas, noise, 0.25F);
  return canvas.ToTexture();
}

Texture MakeDoorPictures(const TileNoise& noise, CampusRandom random) {
  Canvas canvas(512, 512, GreyPaint(0.4F));
  for (int i = 0; i < kDoorPictures.size(); ++i)
    DrawDoor(canvas, AreaOf(canvas, kDoorPictures, i), i, random);
  AddDust(canvas, noise, 0.3F);
  return canvas.ToTexture();
}

Texture MakePlates(CampusRandom random) {
  Canvas canvas(512, 512, Paint(0.5F, 0.5F, 0.5F, 0.0F));
  for (int i = 0; i < 8; ++i)
    DrawTrafficSign(canvas, AreaOf(canvas, kPlates, i), static_cast<TrafficSign>(i));
  for (int i = 8; i < kPlates.size(); ++i) {
    const Area area = AreaOf(canvas, kPlates, i);
    const bool is_dark = random.Chance(0.5);
    FillArea(canvas, area, is_dark ? OpaquePaint(0.14F, 0.19F, 0.33F) : GreyPaint(0.88F));
    DrawTextWithin(std::to_string(2 + random.Index(97)),
                   area.At(0.1F, 0.2F),
                   area.At(0.9F, 0.8F),
                   {.height = 70.0F, .stroke = 12.0F, .paint = GreyPaint(is_dark ? 0.9F : 0.1F)},
                   canvas);
  }
  return canvas.ToTexture();
}

Texture MakeLicencePlates(CampusRandom random) {
  Canvas canvas(256, 256, GreyPaint(0.85F));
  for (int i = 0; i < kLicencePlates.size(); ++i) {
    const Area area = AreaOf(canvas, kLicencePlates, i);
    FillArea(canvas, area, GreyPaint(0.86F, 0.01F));
    canvas.FillRectangle(area.low, area.At(0.09F, 1.0F), OpaquePaint(0.15F, 0.25F, 0.55F));
    std::string text;
    for (int k = 0; k < 2; ++k)
      text += static_cast<char>('A' + random.Index(26));
    text += '-';
    text += std::to_string(100 + random.Index(900));
    DrawTextWithin(text,
                   area.At(0.14F, 0.2F),
                   area.At(0.96F, 0.8F),
                   {.height = 19.0F, .stroke = 3.0F},
                   canvas);
  }
  return canvas.ToTexture();
}

Texture MakeRoadDetails(const TileNoise& noise) {
  Canvas canvas(256, 256, Paint(0.2F, 0.2F, 0.2F, 0.0F));
  DrawManhole(canvas, AreaOf(canvas, kRoadDetails, 0));
  DrawDrain(canvas, AreaOf(canvas, kRoadDetails, 1));
  DrawBlot(canvas, AreaOf(canvas, kRoadDetails, 2), noise, GreyPaint(0.24F, 0.004F));
  DrawBlot(canvas, AreaOf(canvas, kRoadDetails, 3), noise, GreyPaint(0.31F, 0.004F));
  return canvas.ToTexture();
}

Texture MakeCracks(CampusRandom random) {
  Canvas canvas(512, 512, Paint(0.13F, 0.13F, 0.13F, 0.0F));
  for (int crack = 0; crack < 7; ++crack) {
    Vector2f p = {random.Uniform(60.0F, 450.0F), random.Uniform(60.0F, 450.0F)};
    float direction = random.Uniform(0.0F, 6.28F);
    const float width = random.Uniform(2.0F, 5.5F);
    for (int step = 0; step < 26; ++step) {
      direction += random.Uniform(-0.55F, 0.55F);
      const float stride = random.Uniform(8.0F, 16.0F);
      const Vector2f next = p + stride * Vector2f(std::cos(direction), std::sin(direction));
      canvas.DrawStroke(p, next, width * random.Uniform(0.7F, 1.2F), GreyPaint(0.14F));
      p = next;
    }
  }
  return canvas.ToTexture();
}

Texture MakeStains(const TileNoise& noise) {
  constexpr int kSide = 256;
  Canvas canvas(kSide, kSide, Paint(0.3F, 0.3F, 0.27F, 0.0F));
  canvas.Fill([&](int x, int y) {
    const float u = static_cast<float>(x) / kSide;
    const float v = static_cast<float>(y) / kSide;
    const float streak = noise.Cloud(3.0F * u, 0.2F * v);
    const float fine = noise.Cloud(5.0F * u, 5.0F * v) - 0.5F;
    const float fade = 1.0F - v + 0.5F * (streak - 0.5F);
    const float rim = std::min({6.0F * u, 6.0F * (1.0F - u), 1.0F});
    const float grain =
        HashedUnit(static_cast<std::uint32_t>(x), static_cast<std::uint32_t>(y), 9U);
    Paint paint = GreyPaint(0.42F + 0.2F * fine, 0.02F);
    paint[3] = fade * rim * streak * 1.5F > 0.35F + 0.65F * grain ? 1.0F : 0.0F;
    return paint;
  });
  return canvas.ToTexture();
}

Texture MakeLeaves(
    float leaf_length, float slimness, const Paint& dark, const Paint& light, CampusRandom random) {
  constexpr float kSide = 256.0F;
  Canvas canvas(256, 256, Paint(dark[0], dark[1], dark[2], 0.0F));
  const Paint twig = OpaquePaint(0.3F, 0.25F, 0.2F);
  for (int i = 0; i < 5; ++i) {
    const float angle = 6.28F * (static_cast<float>(i) + random.Unit()) / 5.0F;
    canvas.DrawStroke({128.0F, 128.0F},
                      Vector2f(128.0F, 128.0F) + 95.0F * Vector2f(std::cos(angle), std::sin(angle)),
                      3.0F,
                      twig);
  }
  const int count = static_cast<int>(0.95F / (leaf_length * leaf_length * slimness));
  for (int i = 0; i < count; ++i) {
    const float radius = 0.46F * std::pow(random.Unit(), 0.62F) * kSide;
    const float where = random.Uniform(0.0F, 6.28F);
    const float turn = where + random.Uniform(-1.1F, 1.1F);
    const Vector2f centre =
        Vector2f(128.0F, 128.0F) + radius * Vector2f(std::cos(where), std::sin(where));
    const Paint paint = dark + random.Unit() * (light - dark);
    const float half = 0.5F * leaf_length * kSide * random.Uniform(0.75F, 1.15F);
    canvas.FillEllipse(centre, {half, half * slimness}, turn, paint);
    const Vector2f rib = 0.8F * half * Vector2f(std::cos(turn), std::sin(turn));
    canvas.DrawStroke(centre - rib, centre + rib, 1.0F, Shaded(paint, 1.2F));
  }
  return canvas.ToTexture();
}

Texture MakeGrassTuft(CampusRandom random) {
  Canvas canvas(256, 256, Paint(0.3F, 0.36F, 0.19F, 0.0F));
  for (int i = 0; i < 90; ++i) {
    const float x = random.Uniform(40.0F, 216.0F);
    const float height = random.Uniform(90.0F, 235.0F);
    const float lean = random.Uniform(-45.0F, 45.0F);
    const float light = random.Uniform(0.65F, 1.25F);
    const Paint paint = Shaded(
        random.Chance(0.25) ? OpaquePaint(0.5F, 0.47F, 0.29F) : OpaquePaint(0.33F, 0.40F, 0.2F),
        light);
    Vector2f from(x, 256.0F);
    for (int part = 1; part <= 4; ++part) {
      const float t = 0.25F * static_cast<float>(part);
      const Vector2f to(x + lean * t * t, 256.0F - height * t);
      canvas.DrawStroke(from, to, 6.0F - 1.1F * static_cast<float>(part), paint);
      from = to;
    }
  }
  return canvas.ToTexture();
}

}  // namespace relocd
