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
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include <fmt/core.h>

#include "camera/jpeg.h"
#include "camera/pinhole_camera.h"
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

/// What the training of a region needs besides its frames.
struct RegionTraining {
  const SceneMap& map;  ///< Camera, features and whitening.
  const MapTrainingOptions& options;
  int threads = 1;
};

/// The region's head. `show` is called with the share done and a few words, by one thread at a
/// time.
Result<MapRegion> TrainRegion(const RegionFrames& frames,
                              const RegionTraining& training,
                              const std::function<void(double, std::string_view)>& show) {
  const SceneMap& map = training.map;
  const auto images =
      LoadImages(frames.training, map.camera, Pose3(map.R_WD, Eigen::Vector3d::Zero()));
  if (!images) return images.error();
  TrainingSetConfig cells = training.options.cells;
  cells.seed = training.options.seed;
  cells.threads = training.threads;
  const auto set = PrepareTraining(
      *images, PinholeCamera(map.camera), map.features, map.whitening, cells, [&](double done) {
        show(kPreparationShare * done, "features and depths");
      });
  if (!set) return set.error();

  HeadTrainerConfig config = training.options.head;
  config.seed = training.options.seed;
  config.threads = training.threads;
  config.shape.inputs = set->dimension;
  auto head = TrainHead(*set, config, [&](const TrainingProgress& progress) {
    show(kPreparationShare + (1.0 - kPreparationShare) * static_cast<double>(progress.iteration) /
                                 progress.iterations,
         fmt::format("loss {:.2f}, error {:.1f} px, valid {:.0f} %",
                     progress.loss,
                     progress.median_error_px,
                     100.0 * progress.valid));
  });
  if (!head) return std::move(head).error();
  for (HeadLayer& layer : head->layers) {
    RoundAsStored(layer.weights);
    RoundAsStored(layer.bias);
  }
  MapRegion region;
  region.head = std::move(*head);
  region.training_poses = CoarsePoses(*images);
  return region;
}

/// Trains the heads side by side, each on a thread of its own: threads that share one head wait for
/// each other at every step. With fewer regions than threads, a head has several.
Result<void> TrainRegions(const std::vector<RegionFrames>& regions,
                          const MapTrainingOptions& options,
                          SceneMap& map) {
  const std::size_t workers = std::min<std::size_t>(options.threads, regions.size());
  const RegionTraining training{map, options, options.threads / static_cast<int>(workers)};
  TrainingProgressLine line(regions.size());
  std::vector<std::optional<Result<MapRegion>>> trained(regions.size());
  std::atomic<std::size_t> next = 0;
  std::atomic<bool> has_failed = false;
  const auto work = [&] {
    for (std::size_t index = next++; index < regions.size() && !has_failed; index = next++) {
      trained[index] =
          TrainRegion(regions[index], training, [&](double done, std::string_view detail) {
            line.Show(index, done, detail);
          });
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
  for (std::size_t index = 0; index < regions.size(); ++index) {
    map.regions.push_back(std::move(**trained[index]));
    map.regions.back().name = fmt::format("region{}", index);
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
  if (auto done = TrainRegions(regions, options, map); !done) return std::move(done).error();
  for (const RegionFrames& frames : regions) {
    map.training.training_frames += static_cast<std::uint32_t>(frames.training.size());
  }
  std::vector<DatasetFrame> held_out;
  for (const RouteFrame& frame : *route) {
    if (frame.is_held_out) held_out.push_back(frame.frame);
  }

  if (auto calibrated = CalibrateRegions(held_out, options.threads, map); !calibrated) {
    return std::move(calibrated).error();
  }
  auto localizations = LocalizeFrames(map, held_out, options.threads);
  if (!localizations) return std::move(localizations).error();
  trained.localizations = std::move(*localizations);
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
