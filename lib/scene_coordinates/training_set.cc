#include "scene_coordinates/training_set.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <iterator>
#include <memory>
#include <mutex>
#include <optional>
#include <random>
#include <span>
#include <thread>
#include <utility>

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "core/check.h"
#include "features/gradient_histograms.h"
#include "scene_coordinates/onednn_head.h"
#include "scene_coordinates/plane_sweep.h"

namespace relocd {
namespace {

/// Images whose gradients are in memory together, besides their neighbours'.
constexpr std::size_t kChunk = 16;
/// Neighbours on either side that depths are looked for in.
constexpr std::size_t kNeighbours = 6;
/// A neighbour that has turned more, or hardly moved, tells nothing about depth.
constexpr double kMaxTurnRad = 0.5;
constexpr double kMinBaselineM = 0.3;
constexpr std::size_t kWhiteningCellsPerImage = 150;
/// More of an image's cells to choose those from.
constexpr std::size_t kWhiteningCandidates = 1600;
/// A cell takes the depth of a measured one that is at most this far, in cells.
constexpr float kDepthReach = 0.75F;

/// What is known of one image before copies are made of it.
struct BaseCells {
  std::vector<Eigen::Vector2f> working_pixels;
  std::vector<float> inverse_depths;
};

/// The cells of one image's copies.
struct ViewCells {
  std::vector<Bfloat16> features;
  std::vector<TrainingTarget> targets;
};

/// Calls `work(index)` for each index below `count`, from several threads, each with the state that
/// `make_state()` gives it. Indices are handed out in order.
template <typename MakeState, typename Work>
void ForEachIndex(std::size_t count, int threads, const MakeState& make_state, const Work& work) {
  std::atomic<std::size_t> next = 0;
  const auto run = [&] {
    auto state = make_state();
    for (std::size_t index = next++; index < count; index = next++) {
      work(*state, index);
    }
  };
  std::vector<std::jthread> others;
  for (int thread = 1; thread < threads; ++thread) {
    others.emplace_back(run);
  }
  run();
}

/// Counts what is done, over both passes.
class ProgressCounter {
 public:
  ProgressCounter(std::size_t total, const std::function<void(double)>& progress)
      : total_(total), progress_(progress) {}
  void Add(std::size_t done) {
    const std::lock_guard lock(mutex_);
    done_ += done;
    if (progress_) progress_(static_cast<double>(done_) / static_cast<double>(total_));
  }

 private:
  std::mutex mutex_;
  std::size_t done_ = 0;
  std::size_t total_;
  const std::function<void(double)>& progress_;
};

/// Makes a training set: the state that the steps share.
class Preparation {
 public:
  Preparation(const std::vector<TrainingImage>& images,
              const PinholeCamera& camera,
              const GradientHistogramsConfig& features,
              const FeatureWhitening& whitening,
              const TrainingSetConfig& config)
      : images_(images),
        camera_(camera),
        features_(features),
        whitening_(whitening),
        config_(config) {}

  TrainingSet Run(const std::function<void(double)>& progress);

 private:
  struct ViewState {
    std::unique_ptr<GradientHistograms> extractor;
    std::unique_ptr<OnednnLayers> whitening;
    CellFeatures cells;
    std::vector<float> working;
    std::vector<float> whitened;
  };

  [[nodiscard]] std::unique_ptr<GradientHistograms> MakeExtractor() const {
    return GradientHistograms::Create(features_).value();  // checked before
  }
  [[nodiscard]] std::vector<BaseCells> MeasureChunk(std::size_t chunk) const;
  /// Of the depth image; 0 where it says nothing.
  [[nodiscard]] std::vector<float> GivenDepths(std::size_t image,
                                               const GradientHistograms& extractor,
                                               const std::vector<Eigen::Vector2f>& pixels) const;
  void FindMissingDepths(std::size_t image,
                         std::size_t first,
                         const std::vector<std::unique_ptr<GradientHistograms>>& extractors,
                         BaseCells& base) const;
  [[nodiscard]] std::vector<float> Depths(
      std::size_t image,
      std::size_t first,
      const std::vector<std::unique_ptr<GradientHistograms>>& extractors,
      const std::vector<Eigen::Vector2f>& pixels) const;
  [[nodiscard]] ViewCells MakeViews(ViewState& state,
                                    std::size_t image,
                                    const BaseCells& base) const;
  void AppendView(ViewState& state,
                  std::size_t image,
                  const BaseCells& base,
                  const cv::Matx23f& to_base,
                  ViewCells& out) const;
  [[nodiscard]] float DepthNear(const BaseCells& base, const Eigen::Vector2f& pixel) const;
  [[nodiscard]] cv::Matx23f ChangeView(std::mt19937_64& engine, std::vector<float>& working) const;

  const std::vector<TrainingImage>& images_;
  const PinholeCamera& camera_;
  const GradientHistogramsConfig& features_;
  const FeatureWhitening& whitening_;
  const TrainingSetConfig& config_;
};

std::vector<BaseCells> Preparation::MeasureChunk(std::size_t chunk) const {
  const std::size_t begin = chunk * kChunk;
  const std::size_t end = std::min(begin + kChunk, images_.size());
  const std::size_t first = begin > kNeighbours ? begin - kNeighbours : 0;
  const std::size_t last = std::min(end + kNeighbours, images_.size());
  std::vector<std::unique_ptr<GradientHistograms>> extractors;
  std::vector<BaseCells> bases;
  CellFeatures cells;
  std::vector<float> working;
  for (std::size_t image = first; image < last; ++image) {
    extractors.push_back(MakeExtractor());
    const auto resized = extractors.back()->Resize(images_[image].image, working);
    RELOCD_CHECK(resized.has_value(), "image sizes have been checked");
    extractors.back()->ExtractFromWorkingImage(
        working, static_cast<std::size_t>(config_.cells_per_view), cells);
    if (image < begin || image >= end) continue;
    BaseCells& base = bases.emplace_back();
    base.working_pixels = cells.pixels;
  }
  for (std::size_t image = begin; image < end; ++image) {
    BaseCells& base = bases[image - begin];
    base.inverse_depths = GivenDepths(image, *extractors.front(), base.working_pixels);
    if (config_.measure_depth) FindMissingDepths(image, first, extractors, base);
  }
  return bases;
}

std::vector<float> Preparation::GivenDepths(std::size_t image,
                                            const GradientHistograms& extractor,
                                            const std::vector<Eigen::Vector2f>& pixels) const {
  std::vector<float> inverse_depths;
  inverse_depths.reserve(pixels.size());
  for (const Eigen::Vector2f& pixel : pixels) {
    inverse_depths.push_back(
        MeasuredInverseDepth(images_[image].depth, extractor.FromWorking(pixel)));
  }
  return inverse_depths;
}

void Preparation::FindMissingDepths(
    std::size_t image,
    std::size_t first,
    const std::vector<std::unique_ptr<GradientHistograms>>& extractors,
    BaseCells& base) const {
  std::vector<Eigen::Vector2f> pixels;
  for (std::size_t cell = 0; cell < base.working_pixels.size(); ++cell) {
    if (base.inverse_depths[cell] == 0.0F) pixels.push_back(base.working_pixels[cell]);
  }
  const std::vector<float> found = Depths(image, first, extractors, pixels);
  auto next = found.begin();
  for (float& inverse_depth : base.inverse_depths) {
    if (inverse_depth == 0.0F) inverse_depth = *next++;
  }
}

std::vector<float> Preparation::Depths(
    std::size_t image,
    std::size_t first,
    const std::vector<std::unique_ptr<GradientHistograms>>& extractors,
    const std::vector<Eigen::Vector2f>& pixels) const {
  const SweepView reference{&extractors[image - first]->maps(), images_[image].X_WC};
  std::vector<SweepView> neighbours;
  for (std::size_t other = first; other < first + extractors.size(); ++other) {
    const std::size_t distance = other > image ? other - image : image - other;
    const Pose3 X_CN = images_[image].X_WC.Inverse() * images_[other].X_WC;
    const double turn_rad = X_CN.Log().tail<3>().norm();
    if (images_[other].drive != images_[image].drive || distance > kNeighbours ||
        turn_rad > kMaxTurnRad || X_CN.translation().norm() < kMinBaselineM) {
      continue;
    }
    neighbours.push_back({&extractors[other - first]->maps(), images_[other].X_WC});
  }
  const PlaneSweep sweep(camera_, *extractors.front(), {});
  return sweep.InverseDepths(reference, neighbours, pixels);
}

float Preparation::DepthNear(const BaseCells& base, const Eigen::Vector2f& pixel) const {
  float best = kDepthReach * static_cast<float>(features_.cell_stride);
  best *= best;
  float inverse_depth = 0.0F;
  // Cells are in row-major order: only rows that can be near are looked at.
  const float reach = static_cast<float>(features_.cell_stride);
  const auto begin =
      std::lower_bound(base.working_pixels.begin(),
                       base.working_pixels.end(),
                       pixel.y() - reach,
                       [](const Eigen::Vector2f& cell, float y) { return cell.y() < y; });
  for (auto cell = begin; cell != base.working_pixels.end() && cell->y() < pixel.y() + reach;
       ++cell) {
    const float distance = (*cell - pixel).squaredNorm();
    if (distance < best) {
      best = distance;
      inverse_depth =
          base.inverse_depths[static_cast<std::size_t>(cell - base.working_pixels.begin())];
    }
  }
  return inverse_depth;
}

/// Changes the working image as another camera, light or focus would.
/// @return the map from its pixels to those of the image as it was.
cv::Matx23f Preparation::ChangeView(std::mt19937_64& engine, std::vector<float>& working) const {
  std::uniform_real_distribution<double> symmetric(-1.0, 1.0);
  const double scale = std::pow(config_.max_scale, symmetric(engine));
  const double roll_rad = config_.max_roll_rad * symmetric(engine);
  const double blur_px = config_.max_blur_px * std::abs(symmetric(engine));
  const double shift_u = features_.cell_stride * symmetric(engine);
  const double shift_v = features_.cell_stride * symmetric(engine);

  const double centre_u = 0.5 * features_.working_width;
  const double centre_v = 0.5 * features_.working_height;
  const double cosine = std::cos(roll_rad) / scale;
  const double sine = std::sin(roll_rad) / scale;
  const cv::Matx23d to_base(cosine,
                            -sine,
                            centre_u + shift_u - cosine * centre_u + sine * centre_v,
                            sine,
                            cosine,
                            centre_v + shift_v - sine * centre_u - cosine * centre_v);
  cv::Mat image(features_.working_height, features_.working_width, CV_32F, working.data());
  cv::Mat warped;
  cv::warpAffine(image,
                 warped,
                 to_base,
                 image.size(),
                 cv::INTER_LINEAR | cv::WARP_INVERSE_MAP,
                 cv::BORDER_REFLECT_101);
  constexpr double kLeastBlurPx = 0.3;
  if (blur_px > kLeastBlurPx) cv::GaussianBlur(warped, warped, {0, 0}, blur_px);
  warped.copyTo(image);
  ChangeLight(config_.light, engine, features_.working_width, features_.working_height, working);
  return to_base;
}

void Preparation::AppendView(ViewState& state,
                             std::size_t image,
                             const BaseCells& base,
                             const cv::Matx23f& to_base,
                             ViewCells& out) const {
  state.extractor->ExtractFromWorkingImage(
      state.working, static_cast<std::size_t>(config_.cells_per_view), state.cells);
  state.whitened.resize(state.cells.size() * static_cast<std::size_t>(whitening_.outputs));
  state.whitening->Run(state.cells.values, state.whitened);
  const auto dimension = static_cast<std::size_t>(whitening_.outputs);
  for (std::size_t cell = 0; cell < state.cells.size(); ++cell) {
    const Eigen::Vector2f& pixel = state.cells.pixels[cell];
    const Eigen::Vector2f base_pixel(
        to_base(0, 0) * pixel.x() + to_base(0, 1) * pixel.y() + to_base(0, 2),
        to_base(1, 0) * pixel.x() + to_base(1, 1) * pixel.y() + to_base(1, 2));
    const bool is_inside = base_pixel.x() >= 0.0F && base_pixel.y() >= 0.0F &&
                           base_pixel.x() < static_cast<float>(features_.working_width) &&
                           base_pixel.y() < static_cast<float>(features_.working_height);
    if (!is_inside) continue;
    const auto ray = camera_.Unproject(state.extractor->FromWorking(base_pixel).cast<double>());
    if (!ray) continue;
    out.targets.push_back({static_cast<float>(ray->x()),
                           static_cast<float>(ray->y()),
                           DepthNear(base, base_pixel),
                           static_cast<std::uint32_t>(image)});
    for (std::size_t i = 0; i < dimension; ++i) {
      out.features.push_back(ToBfloat16(state.whitened[cell * dimension + i]));
    }
  }
}

ViewCells Preparation::MakeViews(ViewState& state, std::size_t image, const BaseCells& base) const {
  ViewCells out;
  const auto most = static_cast<std::size_t>(config_.views_per_image) *
                    static_cast<std::size_t>(config_.cells_per_view);
  out.targets.reserve(most);
  out.features.reserve(most * static_cast<std::size_t>(whitening_.outputs));
  std::seed_seq seeds{static_cast<std::uint32_t>(config_.seed),
                      static_cast<std::uint32_t>(config_.seed >> 32U),
                      static_cast<std::uint32_t>(image)};
  std::mt19937_64 engine(seeds);
  for (int view = 0; view < config_.views_per_image; ++view) {
    const auto resized = state.extractor->Resize(images_[image].image, state.working);
    RELOCD_CHECK(resized.has_value(), "image sizes have been checked");
    const cv::Matx23f to_base =
        view == 0 ? cv::Matx23f(1, 0, 0, 0, 1, 0) : ChangeView(engine, state.working);
    AppendView(state, image, base, to_base, out);
  }
  return out;
}

double MedianDepth(const std::vector<BaseCells>& bases) {
  constexpr double kRoadDepthM = 12.0;  // a fair guess where nothing could be measured
  std::vector<float> inverse_depths;
  for (const BaseCells& base : bases) {
    std::copy_if(base.inverse_depths.begin(),
                 base.inverse_depths.end(),
                 std::back_inserter(inverse_depths),
                 [](float inverse_depth) { return inverse_depth > 0.0F; });
  }
  if (inverse_depths.empty()) return kRoadDepthM;
  const auto middle = inverse_depths.begin() + std::ssize(inverse_depths) / 2;
  std::nth_element(inverse_depths.begin(), middle, inverse_depths.end());
  return 1.0 / *middle;
}

TrainingSet Preparation::Run(const std::function<void(double)>& progress) {
  const std::size_t chunks = (images_.size() + kChunk - 1) / kChunk;
  ProgressCounter counter(2 * images_.size(), progress);
  std::vector<std::vector<BaseCells>> chunk_bases(chunks);
  const auto no_state = [] { return std::make_unique<int>(0); };
  ForEachIndex(chunks, config_.threads, no_state, [&](int& /*state*/, std::size_t chunk) {
    chunk_bases[chunk] = MeasureChunk(chunk);
    counter.Add(chunk_bases[chunk].size());
  });
  std::vector<BaseCells> bases;
  for (std::vector<BaseCells>& chunk : chunk_bases) {
    std::move(chunk.begin(), chunk.end(), std::back_inserter(bases));
  }

  TrainingSet set;
  set.dimension = whitening_.outputs;
  set.focal_px = camera_.intrinsics().fx * features_.working_width / features_.image_width;
  set.typical_depth_m = MedianDepth(bases);
  std::vector<ViewCells> views(images_.size());
  const auto make_state = [&] {
    auto state = std::make_unique<ViewState>();
    state->extractor = MakeExtractor();
    state->whitening = OnednnLayers::ForWhitening(whitening_, TeamOfOne()).value();
    return state;
  };
  ForEachIndex(
      images_.size(), config_.threads, make_state, [&](ViewState& state, std::size_t image) {
        views[image] = MakeViews(state, image, bases[image]);
        counter.Add(1);
      });
  std::size_t cells = 0;
  for (const ViewCells& view : views) {
    cells += view.targets.size();
  }
  set.targets.reserve(cells);
  set.features.reserve(cells * static_cast<std::size_t>(whitening_.outputs));
  for (ViewCells& view : views) {
    set.targets.insert(set.targets.end(), view.targets.begin(), view.targets.end());
    set.features.insert(set.features.end(), view.features.begin(), view.features.end());
    view = {};
  }
  for (const TrainingImage& image : images_) {
    set.X_WCs.push_back(image.X_WC);
  }
  return set;
}

Result<void> CheckImage(const GrayImage& image,
                        std::size_t index,
                        const GradientHistogramsConfig& features) {
  if (image.width == features.image_width && image.height == features.image_height) return {};
  return Error{ErrorKind::kInvalidInput,
               fmt::format("training image {} is {} x {} pixels, must be {} x {}",
                           index,
                           image.width,
                           image.height,
                           features.image_width,
                           features.image_height)};
}

Result<void> CheckDepth(const MeasuredDepth& depth,
                        std::size_t index,
                        const GradientHistogramsConfig& features) {
  if (depth.depth_mm.empty()) return {};
  if (depth.width == features.image_width && depth.height == features.image_height) return {};
  return Error{ErrorKind::kInvalidInput,
               fmt::format("depth of training image {} is {} x {} pixels, must be {} x {}",
                           index,
                           depth.width,
                           depth.height,
                           features.image_width,
                           features.image_height)};
}

}  // namespace

Result<FeatureWhitening> FitWhiteningToImages(const std::vector<GrayImage>& images,
                                              const GradientHistogramsConfig& features,
                                              int outputs) {
  auto extractor = GradientHistograms::Create(features);
  if (!extractor) return std::move(extractor).error();
  std::vector<float> samples;
  CellFeatures cells;
  for (std::size_t index = 0; index < images.size(); ++index) {
    if (auto valid = CheckImage(images[index], index, features); !valid) return valid.error();
    const auto extracted = (*extractor)->Extract(images[index], kWhiteningCandidates, cells);
    RELOCD_CHECK(extracted.has_value(), "the image's size has been checked");
    const std::size_t stride = std::max<std::size_t>(1, cells.size() / kWhiteningCellsPerImage);
    const auto dimension = static_cast<std::size_t>(cells.dimension);
    for (std::size_t cell = 0; cell < cells.size(); cell += stride) {
      const auto from = cells.values.begin() + static_cast<std::ptrdiff_t>(cell * dimension);
      samples.insert(samples.end(), from, from + cells.dimension);
    }
  }
  return FitWhitening(samples, (*extractor)->dimension(), outputs);
}

// NOLINTNEXTLINE(readability-function-size): six different things, none of which belongs to another
Result<TrainingSet> PrepareTraining(const std::vector<TrainingImage>& images,
                                    const PinholeCamera& camera,
                                    const GradientHistogramsConfig& features,
                                    const FeatureWhitening& whitening,
                                    const TrainingSetConfig& config,
                                    const std::function<void(double)>& progress) {
  if (auto valid = Validate(features); !valid) return std::move(valid).error();
  if (whitening.inputs != GradientHistogramsDimension(features)) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("whitening.inputs is {}, must be {} as the features'",
                             whitening.inputs,
                             GradientHistogramsDimension(features))};
  }
  for (std::size_t index = 0; index < images.size(); ++index) {
    if (auto valid = CheckImage(images[index].image, index, features); !valid) return valid.error();
    if (auto valid = CheckDepth(images[index].depth, index, features); !valid) return valid.error();
  }
  return Preparation(images, camera, features, whitening, config).Run(progress);
}

}  // namespace relocd
