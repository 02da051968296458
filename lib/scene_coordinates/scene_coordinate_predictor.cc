#include "scene_coordinates/scene_coordinate_predictor.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "core/check.h"

namespace relocd {

namespace {

/// The least time of a few runs over some cells.
std::chrono::nanoseconds TimeOf(OnednnLayers& layers) {
  constexpr std::size_t kRows = 512;
  constexpr int kRuns = 5;
  const std::vector<float> in(kRows * static_cast<std::size_t>(layers.inputs()), 0.5F);
  std::vector<float> out(kRows * static_cast<std::size_t>(layers.outputs()));
  auto least = std::chrono::nanoseconds::max();
  for (int run = 0; run < kRuns; ++run) {
    const auto start = std::chrono::steady_clock::now();
    layers.Run(in, out);
    least = std::min<std::chrono::nanoseconds>(least, std::chrono::steady_clock::now() - start);
  }
  return least;
}

/// Which precision is the faster one for this head on this CPU. bfloat16 must be clearly faster:
/// where there is little to choose, the choice should not hang on chance.
Result<Precision> MeasureFastest(const Head& head, const std::shared_ptr<ThreadTeam>& team) {
  constexpr double kClearly = 0.8;
  if (FastestPrecision() != Precision::kBfloat16) return Precision::kFloat32;
  auto narrow = OnednnLayers::ForHead(head, Precision::kBfloat16, team);
  if (!narrow) return Precision::kFloat32;
  auto wide = OnednnLayers::ForHead(head, Precision::kFloat32, team);
  if (!wide) return std::move(wide).error();
  return TimeOf(**narrow) < kClearly * TimeOf(**wide) ? Precision::kBfloat16 : Precision::kFloat32;
}

}  // namespace

Result<std::unique_ptr<SceneCoordinatePredictor>> SceneCoordinatePredictor::Create(
    const SceneMap& map, int threads, const Progress& progress) {
  std::unique_ptr<SceneCoordinatePredictor> predictor(new SceneCoordinatePredictor(map));
  const auto team = std::make_shared<ThreadTeam>(threads);
  auto extractor = GradientHistograms::Create(map.features, team);
  if (!extractor) return std::move(extractor).error();
  predictor->extractor_ = std::move(*extractor);
  auto whitening = OnednnLayers::ForWhitening(map.whitening, team);
  if (!whitening) return std::move(whitening).error();
  predictor->whitening_ = std::move(*whitening);
  if (!map.regions.empty()) {
    const auto precision = MeasureFastest(map.regions.front().head, team);
    if (!precision) return precision.error();
    predictor->precision_ = *precision;
  }
  for (const MapRegion& region : map.regions) {
    auto head = OnednnLayers::ForHead(region.head, predictor->precision_, team);
    if (!head) return std::move(head).error();
    predictor->heads_.push_back(std::move(*head));
    progress();
  }
  return predictor;
}

Result<void> SceneCoordinatePredictor::Extract(const GrayImage& image) {
  if (auto done = extractor_->Extract(image, map_.cells_per_image, features_); !done) return done;
  whitened_.resize(features_.size() * static_cast<std::size_t>(map_.whitening.outputs));
  whitening_->Run(features_.values, whitened_);
  return {};
}

std::span<const ScenePrediction> SceneCoordinatePredictor::Predict(std::size_t region) {
  RELOCD_CHECK(region < heads_.size(), "there is no such region");
  const Head& head = map_.regions[region].head;
  outputs_.resize(features_.size() * kHeadOutputs);
  heads_[region]->Run(whitened_, outputs_);
  predictions_.resize(features_.size());
  for (std::size_t cell = 0; cell < features_.size(); ++cell) {
    const std::span<const float, kHeadOutputs> output(outputs_.data() + cell * kHeadOutputs,
                                                      kHeadOutputs);
    const ScenePoint point = DecodeHeadOutput(head, output);
    predictions_[cell] = {
        features_.pixels[cell].cast<double>(), point.p_WP.cast<double>(), point.confidence};
  }
  return predictions_;
}

}  // namespace relocd
