#include "map_training.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <functional>
#include <iterator>
#include <mutex>
#include <numeric>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include <fmt/core.h>

#include "camera/jpeg.h"
#include "camera/pinhole_camera.h"
#include "core/sha256.h"
#include "depth_file.h"
#include "features/gradient_histograms.h"
#include "map_calibration.h"
#include "map_route.h"
#include "progress_line.h"

namespace relocd {
namespace {

constexpr std::size_t kMinFrames = 8;
constexpr double kMinRouteM = 0.5;

Error Invalid(std::string message) {
  return {ErrorKind::kInvalidInput, std::move(message)};
}

Result<void> CheckFrames(const Dataset& dataset) {
  if (dataset.frames.size() < kMinFrames) {
    return Invalid(fmt::format("{}: {} training frames, must be at least {}",
                               dataset.directory,
                               dataset.frames.size(),
                               kMinFrames));
  }
  double route_m = 0.0;
  for (std::size_t index = 1; index < dataset.frames.size(); ++index) {
    route_m +=
        (dataset.frames[index].X_WC.translation() - dataset.frames[index - 1].X_WC.translation())
            .norm();
  }
  if (route_m < kMinRouteM) {
    return Invalid(fmt::format("{}: the camera travels {:.3f} m, must be at least {} m",
                               dataset.directory,
                               route_m,
                               kMinRouteM));
  }
  return {};
}

Result<std::vector<TrainingImage>> LoadImages(const std::vector<RouteFrame>& frames,
                                              const CameraIntrinsics& camera,
                                              const Pose3& X_WD) {
  std::vector<TrainingImage> images;
  for (const auto& [frame, drive, along_m, is_held_out] : frames) {
    auto image = ReadGrayImage(frame.image_path);
    if (!image) return std::move(image).error();
    if (image->width != camera.width || image->height != camera.height) {
      return Invalid(
          fmt::format("{}: image is {} x {} pixels, must be {} x {} as intrinsics.txt says",
                      frame.image_path,
                      image->width,
                      image->height,
                      camera.width,
                      camera.height));
    }
    images.push_back({std::move(*image), X_WD * frame.X_WC, static_cast<int>(drive)});
  }
  return images;
}

/// The depth images of those that have one.
Result<void> LoadDepths(const std::vector<RouteFrame>& frames,
                        const CameraIntrinsics& camera,
                        std::vector<TrainingImage>& images) {
  for (std::size_t index = 0; index < frames.size(); ++index) {
    const std::string& path = frames[index].frame.depth_path;
    if (path.empty()) continue;
    auto depth = ReadDepthFile(path, camera.width, camera.height);
    if (!depth) return std::move(depth).error();
    images[index].depth = std::move(*depth);
  }
  return {};
}

std::vector<TrainingPose> CoarsePoses(const std::vector<TrainingImage>& images) {
  std::vector<TrainingPose> poses;
  for (const TrainingImage& image : images) {
    const Eigen::Vector3d forward_W = image.X_WC.R().col(2);
    poses.push_back({image.X_WC.translation().cast<float>(),
                     static_cast<float>(std::atan2(forward_W.y(), forward_W.x()))});
  }
  return poses;
}

/// As the file will have them, so that what is measured is what is stored.
void RoundAsStored(std::vector<float>& values) {
  std::transform(values.begin(), values.end(), values.begin(), RoundToHalf);
}

/// Copies of features and head, in shares of a region's whole time.
constexpr double kPreparationShare = 0.15;
/// Images that the whitening is fitted to, from all along the route.
constexpr std::size_t kWhiteningImages = 240;

/// Shows how far the training of all regions is, from several threads.
class TrainingProgressLine {
 public:
  explicit TrainingProgressLine(std::size_t regions) : line_("training"), done_(regions) {}

  void Show(std::size_t region, double done, std::string_view detail) {
    const std::lock_guard lock(mutex_);
    done_[region] = done;
    const double sum = std::accumulate(done_.begin(), done_.end(), 0.0);
    const auto finished = std::count_if(
        done_.begin(), done_.end(), [](double region_done) { return region_done >= 1.0; });
    line_.Show(
        sum / static_cast<double>(done_.size()),
        fmt::format("{} of {} regions done; region{}: {}", finished, done_.size(), region, detail));
  }

 private:
  std::mutex mutex_;
  ProgressLine line_;
  std::vector<double> done_;  ///< Of each region, in [0, 1].
};

/// What the training of regions needs besides their frames.
struct RegionTraining {
  const SceneMap& map;  ///< Camera, features and whitening.
  const MapTrainingOptions& options;
  int threads = 1;
  const TrainingFolder* folder = nullptr;  ///< If anything is kept.
};

/// The map with one region.
SceneMap MapOf(const SceneMap& map, MapRegion region) {
  SceneMap one;
  one.camera = map.camera;
  one.R_WD = map.R_WD;
  one.features = map.features;
  one.cells_per_image = map.cells_per_image;
  one.whitening = map.whitening;
  one.regions.push_back(std::move(region));
  return one;
}

/// How a head does on some of its region's held-out frames.
LiveAccuracy MeasureLive(const SceneMap& map, const Head& head, const RegionFrames& frames) {
  constexpr std::size_t kFrames = 6;
  std::vector<DatasetFrame> sample;
  const std::size_t count = std::min(kFrames, frames.held_out.size());
  for (std::size_t i = 0; i < count; ++i)
    sample.push_back(frames.held_out[i * frames.held_out.size() / count].frame);
  MapRegion region;
  region.name = "live";
  region.head = head;
  const SceneMap one = MapOf(map, std::move(region));
  const auto localizations = LocalizeFrames(one, sample, 1);
  if (!localizations) return {};  // the whole measurement at the end says why
  const PoseErrors errors = MeasureErrors(one, *localizations);
  return {.frames = errors.frames, .localized = errors.localized, .median_m = errors.median_m};
}

/// Follows the training of one head: says how far it is and how good, and keeps its state.
class RegionObserver {
 public:
  using Show = std::function<void(double, std::string_view)>;

  /// Borrows all.
  RegionObserver(std::size_t region,
                 const RegionFrames& frames,
                 const RegionTraining& training,
                 const Show& show)
      : region_(region), frames_(frames), training_(training), show_(show) {}

  void Prepared(double done) const { show_(kPreparationShare * done, "features and depths"); }

  void Progress(const TrainingProgress& progress) const {
    show_(kPreparationShare + (1.0 - kPreparationShare) * static_cast<double>(progress.iteration) /
                                  progress.iterations,
          fmt::format("loss {:.2f}, error {:.1f} px, valid {:.0f} %{}",
                      progress.loss,
                      progress.median_error_px,
                      100.0 * progress.valid,
                      live_text_));
  }

  /// Every StateEvery() iterations.
  void State(const TrainerState& state, const Head& head) {
    const int done = state.iteration * kLooks / training_.options.head.iterations;
    if (done > looks_ && !frames_.held_out.empty()) {
      looks_ = done;
      LiveAccuracy accuracy = MeasureLive(training_.map, head, frames_);
      accuracy.region = region_;
      accuracy.iteration = state.iteration;
      live_text_ = fmt::format(
          ", held out {:.2f} m, {} of {}", accuracy.median_m, accuracy.localized, accuracy.frames);
      live_.push_back(accuracy);
    }
    const auto now = std::chrono::steady_clock::now();
    const std::chrono::duration<double> since = now - kept_;
    if (training_.folder == nullptr || since.count() < training_.options.checkpoint_every_s) return;
    kept_ = now;
    // A full disk costs the state, not the training.
    (void)training_.folder->KeepState(region_, state).has_value();
  }

  [[nodiscard]] static int StateEvery(int iterations) {
    constexpr int kStates = 40;
    return std::max(1, iterations / kStates);
  }

  [[nodiscard]] std::vector<LiveAccuracy> TakeLive() { return std::move(live_); }

 private:
  static constexpr int kLooks = 5;

  std::size_t region_;
  const RegionFrames& frames_;
  const RegionTraining& training_;
  const Show& show_;
  int looks_ = 0;
  std::string live_text_;
  std::vector<LiveAccuracy> live_;
  std::chrono::steady_clock::time_point kept_ = std::chrono::steady_clock::now();
};

/// A region's head in the making, or taken up from an earlier run.
struct TrainedRegion {
  MapRegion region;
  std::vector<LiveAccuracy> live;
};

Result<TrainedRegion> TrainRegion(std::size_t index,
                                  const RegionFrames& frames,
                                  const RegionTraining& training,
                                  const RegionObserver::Show& show) {
  if (training.folder != nullptr) {
    if (auto finished = training.folder->FinishedRegion(index)) {
      show(1.0, "finished before");
      return TrainedRegion{std::move(*finished), {}};
    }
  }
  const SceneMap& map = training.map;
  auto images = LoadImages(frames.training, map.camera, Pose3(map.R_WD, Eigen::Vector3d::Zero()));
  if (!images) return std::move(images).error();
  if (auto ok = LoadDepths(frames.training, map.camera, *images); !ok) return std::move(ok).error();
  RegionObserver observer(index, frames, training, show);
  TrainingSetConfig cells = training.options.cells;
  cells.seed = training.options.seed;
  cells.threads = training.threads;
  const auto set = PrepareTraining(
      *images, PinholeCamera(map.camera), map.features, map.whitening, cells, [&](double done) {
        observer.Prepared(done);
      });
  if (!set) return set.error();

  HeadTrainerConfig config = training.options.head;
  config.seed = training.options.seed;
  config.threads = training.threads;
  config.shape.inputs = set->dimension;
  const auto state = training.folder == nullptr ? std::nullopt : training.folder->State(index);
  auto head = TrainHead(
      *set,
      config,
      {.progress = [&](const TrainingProgress& progress) { observer.Progress(progress); },
       .state = [&](const TrainerState& now, const Head& so_far) { observer.State(now, so_far); },
       .state_every = RegionObserver::StateEvery(config.iterations),
       .resume = state ? &*state : nullptr});
  if (!head) return std::move(head).error();
  for (HeadLayer& layer : head->layers) {
    RoundAsStored(layer.weights);
    RoundAsStored(layer.bias);
  }
  MapRegion region;
  region.name = fmt::format("region{}", index);
  region.head = std::move(*head);
  region.training_poses = CoarsePoses(*images);
  if (training.folder != nullptr) {
    // As above: what cannot be kept is made again.
    (void)training.folder->KeepRegion(index, MapOf(map, region)).has_value();
  }
  return TrainedRegion{std::move(region), observer.TakeLive()};
}

/// Trains the heads side by side, each on a thread of its own: threads that share one head wait for
/// each other at every step. With fewer regions than threads, a head has several.
Result<void> TrainRegions(const std::vector<RegionFrames>& regions,
                          const MapTrainingOptions& options,
                          TrainedMap& result) {
  const std::size_t workers = std::min<std::size_t>(options.threads, regions.size());
  const RegionTraining training{result.map,
                                options,
                                options.threads / static_cast<int>(workers),
                                result.folder ? &*result.folder : nullptr};
  TrainingProgressLine line(regions.size());
  std::vector<std::optional<Result<TrainedRegion>>> trained(regions.size());
  std::atomic<std::size_t> next = 0;
  std::atomic<bool> has_failed = false;
  const auto work = [&] {
    for (std::size_t index = next++; index < regions.size() && !has_failed; index = next++) {
      using std::placeholders::_1, std::placeholders::_2;
      const auto show = std::bind(&TrainingProgressLine::Show, &line, index, _1, _2);
      trained[index] = TrainRegion(index, regions[index], training, show);
      if (!*trained[index]) has_failed = true;
    }
  };
  {
    std::vector<std::jthread> others;
    for (std::size_t worker = 1; worker < workers; ++worker) {
      others.emplace_back(work);
    }
    work();
  }
  for (const auto& region : trained) {
    if (region && !*region) return region->error();
  }
  for (auto& region : trained) {
    result.map.regions.push_back(std::move((*region)->region));
    const std::vector<LiveAccuracy>& live = (*region)->live;
    result.live.insert(result.live.end(), live.begin(), live.end());
  }
  return {};
}

/// Fitted to images from all along the route, of all drives.
Result<FeatureWhitening> FitRouteWhitening(const std::vector<RouteFrame>& route,
                                           const MapTrainingOptions& options,
                                           const SceneMap& map) {
  std::vector<RouteFrame> frames;
  std::copy_if(route.begin(), route.end(), std::back_inserter(frames), [](const RouteFrame& frame) {
    return !frame.is_held_out;
  });
  std::vector<RouteFrame> sample;
  const std::size_t count = std::min(frames.size(), kWhiteningImages);
  for (std::size_t index = 0; index < count; ++index) {
    sample.push_back(frames[index * frames.size() / count]);
  }
  auto images = LoadImages(sample, map.camera, Pose3());
  if (!images) return std::move(images).error();
  std::vector<GrayImage> pictures;
  for (TrainingImage& image : *images) {
    pictures.push_back(std::move(image.image));
  }
  auto whitening = FitWhiteningToImages(pictures, map.features, options.whitened_dimensions);
  if (!whitening) return std::move(whitening).error();
  RoundAsStored(whitening->mean);
  RoundAsStored(whitening->basis);
  return whitening;
}

/// Of all options that the map's bytes depend on.
std::string FingerprintOf(const MapTrainingOptions& options) {
  const TrainingSetConfig& cells = options.cells;
  const HeadTrainerConfig& head = options.head;
  const Precision precision =
      head.precision == Precision::kFastest ? FastestPrecision() : head.precision;
  return fmt::format("{} {} {} {} {} {} {} {} {} {} {} {} {} {} {} {} {} {} {} {}",
                     RELOCD_VERSION,
                     options.seed,
                     options.region_length_m,
                     options.region_overlap_m,
                     options.held_out_every,
                     options.whitened_dimensions,
                     cells.cells_per_view,
                     cells.views_per_image,
                     cells.max_scale,
                     cells.max_roll_rad,
                     cells.max_blur_px,
                     cells.measure_depth,
                     head.shape.width,
                     head.shape.blocks,
                     head.iterations,
                     head.batch,
                     head.learning_rate,
                     head.initial_tolerance_px,
                     head.final_tolerance_px,
                     precision == Precision::kBfloat16 ? "bfloat16" : "float");
}

/// Opens the folder beside the map, and says on stderr what is taken up.
Result<void> OpenFolder(const std::vector<SelectedFrames>& drives,
                        const MapTrainingOptions& options,
                        std::size_t regions,
                        TrainedMap& result) {
  if (options.resumable_path.empty()) return {};
  const std::string fingerprint = Sha256Hex(FingerprintOf(options) + FingerprintOf(drives));
  auto folder = TrainingFolder::Open(options.resumable_path, fingerprint);
  if (!folder) return std::move(folder).error();
  result.folder = std::move(*folder);
  std::size_t finished = 0;
  std::size_t begun = 0;
  for (std::size_t region = 0; region < regions; ++region) {
    if (result.folder->FinishedRegion(region)) {
      ++finished;
    } else if (result.folder->State(region)) {
      ++begun;
    }
  }
  if (finished + begun == 0) return {};
  fmt::print(stderr,
             "{}: goes on from an earlier run: {} of {} regions finished, {} begun\n",
             result.folder->path(),
             finished,
             regions,
             begun);
  return {};
}

}  // namespace

Result<void> MapTrainingOptions::Validate() const {
  if (auto valid = head.Validate(); !valid) return valid;
  const auto must = [](const char* field, auto value, const char* allowed) {
    return Invalid(fmt::format("{} is {}, must be {}", field, value, allowed));
  };
  if (threads < 1 || threads > 256) return must("--threads", threads, "in [1, 256]");
  if (held_out_every < 2) return must("--held-out-every", held_out_every, "at least 2");
  if (!(region_length_m >= 10.0)) return must("--region-length", region_length_m, "at least 10 m");
  if (whitened_dimensions < 1) {
    return must("whitened dimensions", whitened_dimensions, "at least 1");
  }
  if (!(checkpoint_every_s >= 0.0)) {
    return must("--checkpoint-every", checkpoint_every_s, "at least 0 s");
  }
  if (cells.views_per_image < 1) return must("--views", cells.views_per_image, "at least 1");
  return {};
}

Result<TrainedMap> TrainMap(const std::vector<SelectedFrames>& drives,
                            const MapTrainingOptions& options) {
  if (auto valid = options.Validate(); !valid) return std::move(valid).error();
  const auto start = std::chrono::steady_clock::now();
  for (const SelectedFrames& drive : drives) {
    if (auto enough = CheckFrames(drive.dataset); !enough) return std::move(enough).error();
  }
  const Dataset& first = drives.front().dataset;
  const auto R_WD = RotationToMap(first);
  if (!R_WD) return R_WD.error();
  const auto route = PlaceOnRoute(drives, options.held_out_every);
  if (!route) return route.error();

  TrainedMap trained;
  SceneMap& map = trained.map;
  map.camera = first.intrinsics;
  map.R_WD = *R_WD;
  map.features = GradientHistogramsForImage(map.camera.width, map.camera.height);
  auto whitening = FitRouteWhitening(*route, options, map);
  if (!whitening) return std::move(whitening).error();
  map.whitening = std::move(*whitening);
  const std::vector<RegionFrames> regions =
      DivideRoute(*route, options.region_length_m, options.region_overlap_m);
  if (auto opened = OpenFolder(drives, options, regions.size(), trained); !opened) {
    return std::move(opened).error();
  }
  if (auto done = TrainRegions(regions, options, trained); !done) return std::move(done).error();
  for (const RegionFrames& frames : regions) {
    map.training.training_frames += static_cast<std::uint32_t>(frames.training.size());
  }
  std::vector<DatasetFrame> held_out;
  for (const RouteFrame& frame : *route) {
    if (frame.is_held_out) held_out.push_back(frame.frame);
  }

  if (auto calibrated = CalibrateRegions(*route, options.threads, map); !calibrated) {
    return std::move(calibrated).error();
  }
  auto localizations = LocalizeFrames(map, held_out, options.threads);
  if (!localizations) return std::move(localizations).error();
  trained.localizations = std::move(*localizations);
  trained.route = *route;
  trained.held_out = MeasureErrors(map, trained.localizations);

  for (const SelectedFrames& drive : drives)
    map.training.dataset += (map.training.dataset.empty() ? "" : "+") + drive.name;
  map.training.program_version = RELOCD_VERSION;
  map.training.seed = options.seed;
  map.training.held_out_frames = static_cast<std::uint32_t>(held_out.size());
  map.training.median_error_m = trained.held_out.median_m;
  map.training.p95_error_m = trained.held_out.p95_m;
  map.training.median_error_rad = trained.held_out.median_rad;
  map.training.within_1m = trained.held_out.within_1m;
  trained.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return trained;
}

}  // namespace relocd
