#include "camera/measured_depth.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include <gtest/gtest.h>

namespace relocd {
namespace {

MeasuredDepth Flat(int width, int height, std::uint16_t depth_mm) {
  MeasuredDepth depth{.width = width, .height = height, .depth_mm = {}};
  depth.depth_mm.assign(static_cast<std::size_t>(width * height), depth_mm);
  return depth;
}

TEST(MeasuredDepthTest, IsTheMeanOfThePixelsAround) {
  MeasuredDepth depth = Flat(8, 6, 2000);
  EXPECT_FLOAT_EQ(MeasuredInverseDepth(depth, {3.4F, 2.6F}), 0.5F);
  for (std::size_t u = 0; u < 8; ++u)
    depth.depth_mm[16 + u] = 2090;  // row 2
  EXPECT_FLOAT_EQ(MeasuredInverseDepth(depth, {3.0F, 3.0F}), 1.0F / 2.03F);
}

TEST(MeasuredDepthTest, NothingIsKnownOfAnEmptyImage) {
  EXPECT_EQ(MeasuredInverseDepth(MeasuredDepth(), {0.0F, 0.0F}), 0.0F);
}

TEST(MeasuredDepthTest, NothingIsKnownAtAnEdge) {
  MeasuredDepth depth = Flat(8, 6, 2000);
  for (std::size_t row = 0; row < 6; ++row)
    std::fill_n(depth.depth_mm.begin() + static_cast<std::ptrdiff_t>(8 * row + 4), 4, 5000);
  EXPECT_FLOAT_EQ(MeasuredInverseDepth(depth, {2.0F, 3.0F}), 0.5F);
  EXPECT_EQ(MeasuredInverseDepth(depth, {3.0F, 3.0F}), 0.0F);
  EXPECT_EQ(MeasuredInverseDepth(depth, {4.0F, 3.0F}), 0.0F);
  EXPECT_FLOAT_EQ(MeasuredInverseDepth(depth, {5.0F, 3.0F}), 0.2F);
}

TEST(MeasuredDepthTest, HolesAreLeftOutAsLongAsEnoughIsKnown) {
  MeasuredDepth depth = Flat(5, 5, 4000);
  for (const std::size_t hole : {6U, 7U, 8U, 11U})
    depth.depth_mm[hole] = 0;
  EXPECT_FLOAT_EQ(MeasuredInverseDepth(depth, {2.0F, 2.0F}), 0.25F);
  depth.depth_mm[12] = 0;
  EXPECT_EQ(MeasuredInverseDepth(depth, {2.0F, 2.0F}), 0.0F);
}

TEST(MeasuredDepthTest, PlacesOutsideAreUnknown) {
  const MeasuredDepth depth = Flat(5, 5, 4000);
  EXPECT_EQ(MeasuredInverseDepth(depth, {0.0F, 0.0F}), 0.0F);  // a corner has four
  EXPECT_FLOAT_EQ(MeasuredInverseDepth(depth, {0.0F, 2.0F}), 0.25F);
  EXPECT_EQ(MeasuredInverseDepth(depth, {-7.0F, 2.0F}), 0.0F);
  EXPECT_EQ(MeasuredInverseDepth(depth, {2.0F, 9.0F}), 0.0F);
}

}  // namespace
}  // namespace relocd
