#include "simulation/campus_canvas.h"

#include <string_view>

#include <Eigen/Core>
#include <gtest/gtest.h>

#include "simulation/campus_lettering.h"
#include "simulation/campus_pictures.h"

namespace relocd {
namespace {

/// How much of the canvas has been painted black, in pixels.
float BlackArea(Canvas& canvas) {
  float area = 0.0F;
  for (int y = 0; y < canvas.height(); ++y) {
    for (int x = 0; x < canvas.width(); ++x)
      area += 1.0F - canvas.At(x, y)[0];
  }
  return area;
}

TEST(CampusCanvasTest, NoiseRepeatsWithPeriodOne) {
  const TileNoise noise{CampusRandom(5)};
  CampusRandom random(6);
  for (int i = 0; i < 1000; ++i) {
    const float u = random.Unit();
    const float v = random.Unit();
    ASSERT_NEAR(noise.Cloud(u, v), noise.Cloud(u + 1.0F, v - 2.0F), 2e-3F);
    ASSERT_NEAR(noise.Speckle(u, v), noise.Speckle(u - 1.0F, v + 1.0F), 2e-3F);
  }
}

TEST(CampusCanvasTest, ShapesHaveTheirArea) {
  Canvas rectangle(64, 64, GreyPaint(1.0F));
  rectangle.FillRectangle({10.5F, 20.25F}, {30.0F, 40.75F}, GreyPaint(0.0F));
  EXPECT_NEAR(BlackArea(rectangle), 19.5F * 20.5F, 0.1F);
  Canvas disc(64, 64, GreyPaint(1.0F));
  disc.FillEllipse({32.0F, 32.0F}, {20.0F, 20.0F}, 0.3F, GreyPaint(0.0F));
  EXPECT_NEAR(BlackArea(disc), 3.1416F * 400.0F, 8.0F);
}

TEST(CampusCanvasTest, WhatLiesOutsideIsCutOff) {
  Canvas canvas(16, 16, GreyPaint(1.0F));
  canvas.DrawStroke({-40.0F, 8.0F}, {40.0F, 8.0F}, 4.0F, GreyPaint(0.0F));
  EXPECT_NEAR(BlackArea(canvas), 16.0F * 4.0F, 1.0F);
}

TEST(CampusCanvasTest, LettersDifferFromEachOther) {
  constexpr std::string_view kLetters = "ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789&-.";
  const auto drawn = [](char letter) {
    Canvas canvas(32, 32, GreyPaint(1.0F));
    DrawText({&letter, 1}, {8.0F, 28.0F}, {.height = 24.0F, .stroke = 2.0F}, canvas);
    return canvas;
  };
  for (const char a : kLetters) {
    Canvas first = drawn(a);
    EXPECT_GT(BlackArea(first), 2.0F) << a;
    for (const char b : kLetters) {
      if (a >= b) continue;
      Canvas second = drawn(b);
      float difference = 0.0F;
      for (int i = 0; i < 32 * 32; ++i)
        difference += (first.At(i % 32, i / 32) - second.At(i % 32, i / 32)).abs()[0];
      EXPECT_GT(difference, 3.0F) << a << b;
    }
  }
}

TEST(CampusCanvasTest, TextIsMadeSmallerUntilItFits) {
  Canvas canvas(64, 16, GreyPaint(1.0F));
  DrawTextWithin("A LONG NAME", {8.0F, 2.0F}, {56.0F, 14.0F}, {.height = 40.0F}, canvas);
  for (int y = 0; y < 16; ++y) {
    for (const int x : {0, 3, 60, 63})
      EXPECT_EQ(canvas.At(x, y)[0], 1.0F);
  }
  EXPECT_GT(BlackArea(canvas), 20.0F);
}

TEST(CampusCanvasTest, PicturesOfAGridDoNotOverlap) {
  const PictureGrid grid{2, 4};
  const PicturePart first = grid.Part(0);
  const PicturePart second = grid.Part(1);
  const PicturePart below = grid.Part(2);
  EXPECT_LT(first.high.x(), second.low.x());
  EXPECT_GT(first.low.y(), below.high.y());
  EXPECT_GT(first.high.y(), 0.99F);
}

}  // namespace
}  // namespace relocd
