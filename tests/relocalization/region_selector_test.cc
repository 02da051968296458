#include "relocalization/region_selector.h"

#include <algorithm>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace relocd {
namespace {

using testing::ElementsAre;
using testing::SizeIs;

/// Regions of 100 m along x with 20 m of overlap: the camera drives and looks along x.
std::vector<MapRegion> Route(std::size_t count) {
  std::vector<MapRegion> regions(count);
  for (std::size_t index = 0; index < count; ++index) {
    const float begin_m = 80.0F * static_cast<float>(index);
    for (float x = begin_m; x <= begin_m + 100.0F; x += 1.0F)
      regions[index].training_poses.push_back({{x, 0.0F, 1.5F}, 0.0F});
  }
  return regions;
}

/// Looks along x at heading 0.
CameraPrior PriorAt(double x, double heading_rad = 0.0, double sigma_m = 0.5) {
  const Eigen::Quaterniond ahead(0.5, -0.5, 0.5, -0.5);
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(heading_rad, Eigen::Vector3d::UnitZ()));
  return {.X_WC = Pose3(turn * ahead, {x, 0.5, 1.5}), .sigma_m = sigma_m, .sigma_rad = 0.02};
}

TEST(RegionSelectorTest, TakesTheRegionsThatWereLearnedWhereTheCameraIsExpected) {
  const std::vector<MapRegion> regions = Route(20);
  RegionSelector selector(regions, 3);
  selector.Report(5);
  EXPECT_THAT(selector.Choose(PriorAt(450.0)), ElementsAre(5));
  EXPECT_THAT(selector.Choose(PriorAt(490.0)), ElementsAre(5, 6)) << "both know this place";
  selector.Report(6);
  EXPECT_THAT(selector.Choose(PriorAt(490.0)), ElementsAre(6, 5)) << "the last one first";
}

TEST(RegionSelectorTest, NeverTriesMoreThanTheLimitHoweverLittleIsKnown) {
  const std::vector<MapRegion> regions = Route(50);
  RegionSelector selector(regions, 3);
  EXPECT_THAT(selector.Choose({}), SizeIs(3));
  EXPECT_THAT(selector.Choose(PriorAt(450.0, 0.0, 1000.0)), SizeIs(3));
  selector.Report(7);
  EXPECT_THAT(selector.Choose(PriorAt(450.0, 0.0, 1000.0)), SizeIs(3));
  EXPECT_THAT(selector.Choose({}), ElementsAre(7, 8, 6));
}

TEST(RegionSelectorTest, ComesPastEveryRegionWhenLostWhateverIsExpected) {
  const std::vector<MapRegion> regions = Route(50);
  for (const auto& prior : {std::optional<CameraPrior>(),
                            std::optional(PriorAt(450.0)),
                            std::optional(PriorAt(450.0, 0.0, 1000.0))}) {
    RegionSelector selector(regions, 3);
    std::set<std::size_t> tried;
    for (int image = 0; image < 50; ++image) {
      const auto chosen = selector.Choose(prior);
      EXPECT_EQ(std::set<std::size_t>(chosen.begin(), chosen.end()).size(), 3U) << "each once";
      tried.insert(chosen.begin(), chosen.end());
      selector.Report({});
    }
    EXPECT_THAT(tried, SizeIs(50));
  }
}

TEST(RegionSelectorTest, AnExpectationOffTheRouteOrTheWrongWayRoundIsNone) {
  const std::vector<MapRegion> regions = Route(5);
  RegionSelector selector(regions, 3);
  selector.Report(2);
  EXPECT_THAT(selector.Choose(PriorAt(-300.0)), SizeIs(3));
  EXPECT_THAT(selector.Choose(PriorAt(200.0, 3.0)), SizeIs(3));
  EXPECT_THAT(selector.Choose(PriorAt(200.0)), ElementsAre(2));
}

TEST(RegionSelectorTest, AMapOfOneRegionHasNoChoice) {
  const std::vector<MapRegion> regions = Route(1);
  RegionSelector selector(regions, 3);
  EXPECT_THAT(selector.Choose({}), ElementsAre(0));
  EXPECT_THAT(selector.Choose(PriorAt(30.0)), ElementsAre(0));
  selector.Report(0);
  EXPECT_THAT(selector.Choose({}), ElementsAre(0));
}

}  // namespace
}  // namespace relocd
