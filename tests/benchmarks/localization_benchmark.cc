// From the gray image to the pose: features, heads of the regions tried, RANSAC, on a rendered
// picture of the campus with its shipped map, 640 x 480. Counters give the middle and the 99th
// percentile of single images, in ms.

#include <algorithm>
#include <chrono>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <benchmark/benchmark.h>

#include "camera/jpeg.h"
#include "core/check.h"
#include "relocalization/map_localizer.h"
#include "simulation/frame_renderer.h"
#include "simulation/session.h"
#include "simulation/world.h"

namespace relocd {
namespace {

constexpr std::size_t kKnownRegion = 2;

const SceneMap& ShippedMap() {
  static const SceneMap map = [] {
    auto read = ReadMap(std::string(RELOCD_SOURCE_DIR) + "/config/maps/campus.relocmap");
    RELOCD_CHECK(read.has_value(), "the shipped map can be read");
    return std::move(*read);
  }();
  return map;
}

/// Of the middle of the known region's training drive, looking ahead.
Pose3 CameraPose() {
  const auto& poses = ShippedMap().regions[kKnownRegion].training_poses;
  const TrainingPose& pose = poses[poses.size() / 6];
  const Eigen::Quaterniond ahead(0.5, -0.5, 0.5, -0.5);
  const Eigen::Quaterniond turn(
      Eigen::AngleAxisd(static_cast<double>(pose.heading_rad), Eigen::Vector3d::UnitZ()));
  return {turn * ahead, pose.p_WC.cast<double>()};
}

const GrayImage& Picture() {
  static const GrayImage gray = [] {
    const World world = MakeWorld("campus", 7).value();
    const auto renderer = FrameRenderer::Create(
        world, ParseSession("afternoon").value(), {.intrinsics = ShippedMap().camera});
    RgbImage image;
    for (int frame = 0; frame < 4; ++frame) {  // the exposure settles
      image = (*renderer)->Render(100'000'000 * frame, [](std::int64_t) { return CameraPose(); });
    }
    return DecodeJpegToGray(EncodeRgbToJpeg(image, 90).value()).value();
  }();
  return gray;
}

/// Reports what single images took.
class Percentiles {
 public:
  template <typename Work>
  void Time(const Work& work) {
    const auto start = std::chrono::steady_clock::now();
    work();
    Add(std::chrono::steady_clock::now() - start);
  }
  void Add(Duration elapsed) { ms_.push_back(1e3 * ToSeconds(elapsed)); }
  void Report(const std::string& prefix, benchmark::State& state) {
    std::ranges::sort(ms_);
    state.counters[prefix + "p50_ms"] = ms_[ms_.size() / 2];
    state.counters[prefix + "p99_ms"] = ms_[ms_.size() * 99 / 100];
  }

 private:
  std::vector<double> ms_;
};

/// Reading a map of so many regions and making it ready: what inferenced does at its start.
void BM_LoadMap(benchmark::State& state) {
  SceneMap map = ShippedMap();
  const std::vector<MapRegion> regions = map.regions;
  while (map.regions.size() < static_cast<std::size_t>(state.range(0)))
    map.regions.insert(map.regions.end(), regions.begin(), regions.end());
  map.regions.resize(static_cast<std::size_t>(state.range(0)));
  const std::string bytes = SerializeMap(map);
  for (auto _ : state) {
    auto parsed = ParseMap(bytes, "map");
    benchmark::DoNotOptimize(MapLocalizer::Create(std::move(*parsed), {}));
  }
}
BENCHMARK(BM_LoadMap)->Arg(1)->Arg(5)->Arg(20)->Unit(benchmark::kMillisecond);

void BM_ExtractFeatures(benchmark::State& state) {
  const auto extractor =
      GradientHistograms::Create(ShippedMap().features,
                                 std::make_shared<ThreadTeam>(static_cast<int>(state.range(0))))
          .value();
  const GrayImage& picture = Picture();
  CellFeatures features;
  Percentiles percentiles;
  for (auto _ : state) {
    percentiles.Time([&] {
      RELOCD_CHECK(extractor->Extract(picture, ShippedMap().cells_per_image, features),
                   "the picture has the map's size");
    });
  }
  percentiles.Report("", state);
}
BENCHMARK(BM_ExtractFeatures)->Arg(1)->Arg(2)->Unit(benchmark::kMillisecond)->UseRealTime();

/// Arguments: threads, regions of the map, whether the camera's place is roughly expected.
void BM_Localize(benchmark::State& state) {
  SceneMap map = ShippedMap();
  const MapRegion known = map.regions[kKnownRegion];
  MapRegion elsewhere = map.regions.back();
  for (TrainingPose& pose : elsewhere.training_poses)
    pose.p_WC.x() += 10'000.0F;
  map.regions.assign(static_cast<std::size_t>(state.range(1)), elsewhere);
  map.regions.front() = known;
  InferenceConfig config;
  config.threads = static_cast<int>(state.range(0));
  const auto localizer = MapLocalizer::Create(std::move(map), config).value();
  std::optional<CameraPrior> prior;
  if (state.range(2) != 0) prior = {.X_WC = CameraPose(), .sigma_m = 0.5, .sigma_rad = 0.02};
  const GrayImage& picture = Picture();
  Percentiles percentiles;
  std::uint64_t seed = 0;
  int poses = 0;
  Duration features{};
  Duration heads{};
  Percentiles pose;
  for (auto _ : state) {
    percentiles.Time([&] {
      const auto localization =
          localizer->Localize(picture, prior, seed++, [] { return ReadClocks().monotonic; });
      if (localization->region == 0) ++poses;
      features += localization->features_time;
      heads += localization->head_time;
      pose.Add(localization->pose_time);
    });
  }
  percentiles.Report("", state);
  pose.Report("pose_", state);
  const auto mean_ms = [&state](Duration sum) {
    return 1e3 * ToSeconds(sum) / static_cast<double>(state.iterations());
  };
  state.counters["features_ms"] = mean_ms(features);
  state.counters["heads_ms"] = mean_ms(heads);
  state.counters["found"] = static_cast<double>(poses) / static_cast<double>(state.iterations());
}
BENCHMARK(BM_Localize)
    ->ArgNames({"threads", "regions", "expected"})
    ->ArgsProduct({{1, 2}, {1, 5, 20, 50}, {1}})
    ->ArgsProduct({{1}, {5, 50}, {0}})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

}  // namespace
}  // namespace relocd
