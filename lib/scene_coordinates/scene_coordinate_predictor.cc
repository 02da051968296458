#include "scene_coordinates/scene_coordinate_predictor.h"

#include <utility>

#include "core/check.h"

namespace relocd {

Result<std::unique_ptr<SceneCoordinatePredictor>> SceneCoordinatePredictor::Create(
    const SceneMap& map, int threads) {
  std::unique_ptr<SceneCoordinatePredictor> predictor(new SceneCoordinatePredictor(map));
  auto extractor = GradientHistograms::Create(map.features, threads);
  if (!extractor) return std::move(extractor).error();
  predictor->extractor_ = std::move(*extractor);
  auto whitening = OnednnLayers::ForWhitening(map.whitening, threads);
  if (!whitening) return std::move(whitening).error();
  predictor->whitening_ = std::move(*whitening);
  for (const MapRegion& region : map.regions) {
    auto head = OnednnLayers::ForHead(region.head, Precision::kFastest, threads);
    if (!head) return std::move(head).error();
    predictor->heads_.push_back(std::move(*head));
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
