#include "corner_tracks.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <iterator>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

#include <fmt/format.h>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

#include "camera/jpeg.h"
#include "camera/pinhole_camera.h"

namespace relocd {
namespace {

/// Images are tracked on at most this wide: enough corners, and the time is bounded.
constexpr int kWorkingWidth = 640;
constexpr int kMaxCorners = 160;
constexpr std::size_t kWindowFrames = 24;
/// Views are at least so far apart, in working pixels: what moved less tells nothing.
constexpr double kLeastMotionPx = 2.0;
/// A step of this many usual ones is a gap, over which nothing is followed.
constexpr double kGapSteps = 6.0;

/// Frames next to each other: the first is the last of the window before, unless there is a gap.
struct Window {
  std::size_t begin = 0;
  std::size_t end = 0;
};

double MedianStep(const Dataset& dataset) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < dataset.frames.size(); ++i) {
    steps.push_back(
        (dataset.frames[i].X_WC.translation() - dataset.frames[i - 1].X_WC.translation()).norm());
  }
  if (steps.empty()) return 0.0;
  const auto middle = steps.begin() + std::ssize(steps) / 2;
  std::nth_element(steps.begin(), middle, steps.end());
  return *middle;
}

/// Whether frames were left out between this and the one before: by a split, say.
bool IsCut(const Dataset& dataset, std::size_t frame, double gap_m) {
  const DatasetFrame& before = dataset.frames[frame - 1];
  const DatasetFrame& here = dataset.frames[frame];
  constexpr int kMaxLeftOut = 2;
  const bool left_out = here.index - before.index > kMaxLeftOut + 1;
  return left_out && (here.X_WC.translation() - before.X_WC.translation()).norm() > gap_m;
}

std::vector<Window> MakeWindows(const Dataset& dataset) {
  const double gap_m = kGapSteps * MedianStep(dataset);
  std::vector<Window> windows;
  std::size_t begin = 0;
  for (std::size_t frame = 1; frame <= dataset.frames.size(); ++frame) {
    const bool at_end = frame == dataset.frames.size();
    const bool is_cut = !at_end && IsCut(dataset, frame, gap_m);
    if (!at_end && !is_cut && frame - begin < kWindowFrames) continue;
    if (frame - begin >= 2) windows.push_back({begin, frame});
    begin = at_end || is_cut ? frame : frame - 1;
  }
  return windows;
}

/// Evenly spread windows, so many that the budget lasts.
std::vector<Window> ChooseWindows(const Dataset& dataset, double pixel_budget) {
  const std::vector<Window> all = MakeWindows(dataset);
  const double image_pixels =
      std::min(1.0, std::pow(kWorkingWidth / 1.0 / dataset.intrinsics.width, 2)) *
      dataset.intrinsics.width * dataset.intrinsics.height;
  const double windows = pixel_budget / (image_pixels * static_cast<double>(kWindowFrames));
  const auto count = static_cast<std::size_t>(
      std::clamp(windows, 2.0, static_cast<double>(std::max<std::size_t>(2, all.size()))));
  if (count >= all.size()) return all;
  std::vector<Window> chosen;
  for (std::size_t i = 0; i < count; ++i)
    chosen.push_back(all[i * (all.size() - 1) / (count - 1)]);
  return chosen;
}

/// The energy of brightness steps along one direction.
double StepEnergy(const cv::Mat& image, bool along_x) {
  cv::Mat steps;
  cv::Sobel(image, steps, CV_32F, along_x ? 1 : 0, along_x ? 0 : 1, 1);
  return steps.dot(steps);
}

/// The blur along one direction. An edge of blur s has a step energy of 1/s; blurred by 1 px more,
/// of 1/sqrt(s^2 + 1).
double EstimateBlurPx(const cv::Mat& gray, bool along_x) {
  constexpr double kMaxPx = 20.0;
  cv::Mat smoother;
  const cv::Mat kernel = cv::getGaussianKernel(7, 1.0, CV_32F);
  const cv::Mat none = cv::Mat::ones(1, 1, CV_32F);
  cv::sepFilter2D(gray, smoother, -1, along_x ? kernel : none, along_x ? none : kernel);
  const double after = StepEnergy(smoother, along_x);
  const double ratio = after > 0.0 ? StepEnergy(gray, along_x) / after : 1.0;
  return ratio <= 1.0 ? kMaxPx : std::min(kMaxPx, 1.0 / std::sqrt(ratio * ratio - 1.0));
}

void MeasureSharpness(const cv::Mat& gray, ImageQuality& quality) {
  quality.blur_px = std::max(EstimateBlurPx(gray, true), EstimateBlurPx(gray, false));
  cv::Scalar mean;
  cv::Scalar deviation;
  cv::meanStdDev(gray, mean, deviation);
  const double contrast = deviation[0] * deviation[0] * static_cast<double>(gray.total());
  const double steps = std::min(StepEnergy(gray, true), StepEnergy(gray, false));
  quality.sharpness = contrast > 0.0 ? steps / contrast : 0.0;
}

void MeasureLevels(const cv::Mat& gray, ImageQuality& quality) {
  constexpr double kShare = 0.05;
  std::array<std::size_t, 256> histogram{};
  for (int v = 0; v < gray.rows; ++v) {
    for (int u = 0; u < gray.cols; ++u)
      ++histogram[gray.at<std::uint8_t>(v, u)];
  }
  const auto level_of = [&](double share) {
    const double wanted = share * static_cast<double>(gray.total());
    double count = 0.0;
    std::size_t level = 0;
    for (; level < 255 && count + static_cast<double>(histogram[level]) < wanted; ++level)
      count += static_cast<double>(histogram[level]);
    return static_cast<double>(level);
  };
  quality.dark_level = level_of(kShare);
  quality.light_level = level_of(1.0 - kShare);
  quality.mean_level = cv::mean(gray)[0];
}

/// A corner that is being followed.
struct LiveCorner {
  cv::Point2f at;       ///< In working pixels.
  cv::Point2f at_view;  ///< Where it was in the last view.
  CornerTrack track;
};

/// Follows corners through one window.
class WindowTracker {
 public:
  /// Borrows both.
  WindowTracker(const Dataset& dataset, const PinholeCamera& camera)
      : dataset_(dataset), camera_(camera) {}

  Result<void> Run(const Window& window, TrackedDrive& drive) {
    for (std::size_t frame = window.begin; frame < window.end; ++frame) {
      auto gray = Load(frame);
      if (!gray) return std::move(gray).error();
      const bool is_first = frame == window.begin;
      ImageQuality& quality = drive.images[frame];
      if (!is_first || !quality.looked_at) {
        MeasureSharpness(*gray, quality);
        MeasureLevels(*gray, quality);
      }
      std::vector<cv::Mat> pyramid;
      cv::buildOpticalFlowPyramid(*gray, pyramid, kPatch, kLevels);
      if (!is_first) quality.motion_px = Follow(pyramid) * full_per_working_;
      const bool is_view = is_first || MotionSinceView() >= kLeastMotionPx;
      if (is_view) AddView(static_cast<std::uint32_t>(frame), *gray);
      if (!is_first || !quality.looked_at) quality.corners = static_cast<int>(corners_.size());
      quality.looked_at = true;
      before_ = std::move(pyramid);
    }
    for (LiveCorner& corner : corners_)
      Keep(std::move(corner.track));
    drive.tracks = std::move(done_);
    return {};
  }

 private:
  static constexpr int kLevels = 3;
  inline static const cv::Size kPatch{17, 17};

  Result<cv::Mat> Load(std::size_t frame) {
    const std::string& path = dataset_.frames[frame].image_path;
    auto image = ReadGrayImage(path);
    if (!image) return std::move(image).error();
    const CameraIntrinsics& camera = dataset_.intrinsics;
    if (image->width != camera.width || image->height != camera.height) {
      return Error{
          ErrorKind::kInvalidInput,
          fmt::format("{}: image is {} x {} pixels, must be {} x {} as intrinsics.txt says",
                      path,
                      image->width,
                      image->height,
                      camera.width,
                      camera.height)};
    }
    const cv::Mat whole(image->height, image->width, CV_8UC1, image->pixels.data());
    full_per_working_ = std::max(1.0, image->width / static_cast<double>(kWorkingWidth));
    if (full_per_working_ == 1.0) return whole.clone();
    cv::Mat reduced;
    const cv::Size size(kWorkingWidth,
                        static_cast<int>(std::lround(image->height / full_per_working_)));
    cv::resize(whole, reduced, size, 0.0, 0.0, cv::INTER_AREA);
    return reduced;
  }

  /// @return the corners' median motion, or -1.
  double Follow(const std::vector<cv::Mat>& pyramid) {
    if (corners_.empty()) return -1.0;
    std::vector<cv::Point2f> from;
    for (const LiveCorner& corner : corners_)
      from.push_back(corner.at);
    std::vector<cv::Point2f> to;
    std::vector<cv::Point2f> back = from;
    std::vector<std::uint8_t> found;
    std::vector<std::uint8_t> found_back;
    std::vector<float> errors;
    cv::calcOpticalFlowPyrLK(before_, pyramid, from, to, found, errors, kPatch, kLevels);
    cv::calcOpticalFlowPyrLK(pyramid, before_, to, back, found_back, errors, kPatch, kLevels);
    std::vector<LiveCorner> followed;
    std::vector<double> motions;
    for (std::size_t i = 0; i < corners_.size(); ++i) {
      const bool came_back = cv::norm(back[i] - from[i]) < kMaxReturnPx;
      if (found[i] != 0 && found_back[i] != 0 && came_back && IsInside(to[i], pyramid.front())) {
        corners_[i].at = to[i];
        motions.push_back(cv::norm(to[i] - from[i]));
        followed.push_back(std::move(corners_[i]));
      } else {
        Keep(std::move(corners_[i].track));
      }
    }
    corners_ = std::move(followed);
    constexpr std::size_t kLeastCorners = 8;
    return motions.size() < kLeastCorners ? -1.0 : Median(motions);
  }

  [[nodiscard]] double MotionSinceView() const {
    std::vector<double> motions;
    for (const LiveCorner& corner : corners_)
      motions.push_back(cv::norm(corner.at - corner.at_view));
    return motions.empty() ? kLeastMotionPx : Median(motions);
  }

  void AddView(std::uint32_t frame, const cv::Mat& gray) {
    FindMore(gray);
    std::erase_if(corners_, [&](LiveCorner& corner) {
      const Eigen::Vector2d pixel(full_per_working_ * (corner.at.x + 0.5) - 0.5,
                                  full_per_working_ * (corner.at.y + 0.5) - 0.5);
      const auto ray = camera_.Unproject(pixel);
      if (!ray) {
        Keep(std::move(corner.track));
        return true;
      }
      corner.track.push_back({frame, ray->cast<float>()});
      corner.at_view = corner.at;
      return false;
    });
  }

  void FindMore(const cv::Mat& gray) {
    constexpr double kQuality = 0.01;
    const double apart = std::max(6.0, gray.cols / 40.0);
    cv::Mat free(gray.size(), CV_8UC1, cv::Scalar(255));
    for (const LiveCorner& corner : corners_)
      cv::circle(free, corner.at, static_cast<int>(apart), cv::Scalar(0), cv::FILLED);
    const int wanted = kMaxCorners - static_cast<int>(corners_.size());
    if (wanted <= 0) return;
    std::vector<cv::Point2f> found;
    cv::goodFeaturesToTrack(gray, found, wanted, kQuality, apart, free);
    for (const cv::Point2f& at : found)
      corners_.push_back({.at = at, .at_view = at, .track = {}});
  }

  void Keep(CornerTrack track) {
    if (track.size() >= 2) done_.push_back(std::move(track));
  }

  static bool IsInside(const cv::Point2f& at, const cv::Mat& image) {
    return at.x >= 0.0F && at.y >= 0.0F && at.x <= static_cast<float>(image.cols - 1) &&
           at.y <= static_cast<float>(image.rows - 1);
  }

  static double Median(std::vector<double> values) {
    const auto middle = values.begin() + std::ssize(values) / 2;
    std::nth_element(values.begin(), middle, values.end());
    return *middle;
  }

  static constexpr double kMaxReturnPx = 0.5;

  const Dataset& dataset_;
  const PinholeCamera& camera_;
  double full_per_working_ = 1.0;
  std::vector<cv::Mat> before_;
  std::vector<LiveCorner> corners_;
  std::vector<CornerTrack> done_;
};

/// One drive's windows, worked through by several threads, in any order.
class DriveTracker {
 public:
  DriveTracker(const Dataset& dataset, std::vector<Window> windows)
      : dataset_(dataset), camera_(dataset.intrinsics), windows_(std::move(windows)) {
    parts_.resize(windows_.size());
  }

  void RunThread(const std::function<void(double)>& progress) {
    for (std::size_t next = next_++; next < windows_.size(); next = next_++) {
      TrackedDrive& part = parts_[next];
      part.images.resize(dataset_.frames.size());
      auto tracked = WindowTracker(dataset_, camera_).Run(windows_[next], part);
      const std::scoped_lock lock(mutex_);
      if (!tracked && (!error_ || next < failed_)) {
        error_ = std::move(tracked).error();
        failed_ = next;
      }
      progress(static_cast<double>(++done_) / static_cast<double>(windows_.size()));
    }
  }

  Result<TrackedDrive> Finish() {
    if (error_) return *error_;
    TrackedDrive drive;
    drive.images.resize(dataset_.frames.size());
    for (std::size_t i = 0; i < parts_.size(); ++i) {
      for (std::size_t frame = windows_[i].begin; frame < windows_[i].end; ++frame) {
        ImageQuality& image = drive.images[frame];
        const double motion_px = image.motion_px;
        if (!image.looked_at) image = parts_[i].images[frame];
        image.motion_px = std::max(motion_px, parts_[i].images[frame].motion_px);
      }
      std::move(parts_[i].tracks.begin(), parts_[i].tracks.end(), std::back_inserter(drive.tracks));
    }
    drive.images_looked_at = static_cast<std::size_t>(
        std::count_if(drive.images.begin(), drive.images.end(), [](const auto& image) {
          return image.looked_at;
        }));
    return drive;
  }

 private:
  const Dataset& dataset_;
  PinholeCamera camera_;
  std::vector<Window> windows_;
  std::vector<TrackedDrive> parts_;
  std::atomic<std::size_t> next_ = 0;
  std::mutex mutex_;
  std::size_t done_ = 0;
  std::size_t failed_ = 0;
  std::optional<Error> error_;
};

}  // namespace

Result<TrackedDrive> TrackCorners(const Dataset& dataset,
                                  const CornerTrackingOptions& options,
                                  const std::function<void(double)>& progress) {
  cv::setNumThreads(1);  // the windows are what is done at the same time
  DriveTracker tracker(dataset, ChooseWindows(dataset, options.pixel_budget));
  {
    std::vector<std::jthread> threads;
    for (int thread = 1; thread < options.threads; ++thread)
      threads.emplace_back([&] { tracker.RunThread(progress); });
    tracker.RunThread(progress);
  }
  return tracker.Finish();
}

}  // namespace relocd
