#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <iterator>
#include <limits>
#include <numbers>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <malloc.h>

#include "camera/pinhole_camera.h"
#include "core/exit_code.h"
#include "core/file.h"
#include "map_calibration.h"
#include "map_dataset.h"
#include "map_disturbance.h"
#include "map_evaluation.h"
#include "map_input.h"
#include "map_report.h"
#include "map_route.h"
#include "map_training.h"
#include "scene_coordinates/map_file.h"

// reloc map: makes a map of a recorded drive, finds images in it, and tells what is in it.

namespace relocd {
namespace {

constexpr double kDegrees = 180.0 / std::numbers::pi;

/// The tangent of a pose in the order of its covariance: metres and radians about the camera's
/// axes.
constexpr std::array<std::string_view, 6> kTangent = {"x", "y", "z", "rx", "ry", "rz"};

std::vector<std::pair<std::size_t, std::size_t>> UpperTriangle() {
  std::vector<std::pair<std::size_t, std::size_t>> entries;
  for (std::size_t row = 0; row < kTangent.size(); ++row) {
    for (std::size_t column = row; column < kTangent.size(); ++column)
      entries.emplace_back(row, column);
  }
  return entries;
}

/// `poses.csv` in the data set's coordinates.
std::string FormatPoses(const SceneMap& map, const std::vector<FrameLocalization>& localizations) {
  const Pose3 X_DW = Pose3(map.R_WD, Eigen::Vector3d::Zero()).Inverse();
  std::string text =
      "index,time_s,status,tx_m,ty_m,tz_m,qw,qx,qy,qz,inliers,confidence,sigma_t_m,sigma_r_rad,"
      "region";
  for (const auto& [row, column] : UpperTriangle())
    text += fmt::format(",cov_{}_{}", kTangent[row], kTangent[column]);
  text += "\n";
  auto out = std::back_inserter(text);
  for (const FrameLocalization& localization : localizations) {
    const CameraPoseResult& pose = localization.pose;
    fmt::format_to(out,
                   "{},{:.6f},{}",
                   localization.frame.index,
                   1e-9 * static_cast<double>(localization.frame.time_ns),
                   Name(pose.status));
    if (pose.status != CameraPoseStatus::kOk) {
      fmt::format_to(out,
                     ",,,,,,,,{},{:.4f},,,{}\n",
                     pose.inliers,
                     pose.confidence,
                     std::string(UpperTriangle().size(), ','));
      continue;
    }
    const Pose3 X_DC = X_DW * pose.X_WC;
    const Eigen::Vector3d& t = X_DC.translation();
    const Eigen::Quaterniond& q = X_DC.rotation();
    fmt::format_to(out,
                   ",{:.6f},{:.6f},{:.6f},{:.9f},{:.9f},{:.9f},{:.9f},{},{:.4f},{:.4f},{:.6f},{}",
                   t.x(),
                   t.y(),
                   t.z(),
                   q.w(),
                   q.x(),
                   q.y(),
                   q.z(),
                   pose.inliers,
                   pose.confidence,
                   std::sqrt(pose.covariance.topLeftCorner<3, 3>().trace()),
                   std::sqrt(pose.covariance.bottomRightCorner<3, 3>().trace()),
                   map.regions[localization.region].name);
    for (const auto& [row, column] : UpperTriangle()) {
      const auto i = static_cast<Eigen::Index>(row);
      fmt::format_to(out, ",{:.9g}", pose.covariance(i, static_cast<Eigen::Index>(column)));
    }
    text += "\n";
  }
  return text;
}

/// Whether two cameras see the same: how far apart the pixels of one ray are, at most, over the
/// image.
double MostApartPx(const CameraIntrinsics& a, const CameraIntrinsics& b) {
  constexpr int kSteps = 8;
  const PinholeCamera camera_a(a);
  const PinholeCamera camera_b(b);
  double most_px = 0.0;
  for (int i = 0; i <= kSteps * kSteps; ++i) {
    const int column = i % kSteps;
    const int row = i / kSteps;
    const Eigen::Vector2d pixel(a.width * column / static_cast<double>(kSteps - 1),
                                a.height * row / static_cast<double>(kSteps));
    const auto ray = camera_a.Unproject(pixel);
    if (!ray) continue;
    const auto seen = camera_b.Project(ray->homogeneous());
    if (!seen) return std::numeric_limits<double>::infinity();
    most_px = std::max(most_px, (*seen - pixel).norm());
  }
  return most_px;
}

std::string DescribeCamera(const CameraIntrinsics& camera) {
  return fmt::format("{} x {} px with f {:.1f} {:.1f}, centre {:.1f} {:.1f}, distortion {:.4g}",
                     camera.width,
                     camera.height,
                     camera.fx,
                     camera.fy,
                     camera.cx,
                     camera.cy,
                     fmt::join(camera.distortion, " "));
}

/// @return kInvalidInput when the map was made with another camera than the data set.
Result<void> CheckCamera(const SceneMap& map, const std::string& name, const Dataset& dataset) {
  constexpr double kMaxApart = 0.02;  // of the width; calibrations of one camera differ by less
  const CameraIntrinsics& camera = dataset.intrinsics;
  const bool same_size = map.camera.width == camera.width && map.camera.height == camera.height;
  if (same_size && MostApartPx(map.camera, camera) <= kMaxApart * camera.width) return {};
  return Error{ErrorKind::kInvalidInput,
               fmt::format("{} is a map for another camera ({}) than that of {} ({}): train a map "
                           "with images of this camera",
                           name,
                           DescribeCamera(map.camera),
                           dataset.directory,
                           DescribeCamera(camera))};
}

std::string FormatErrors(const PoseErrors& errors) {
  return fmt::format(
      "localized {} of {} frames: {}; off by > 10 m {}; rank correlation of sigma and error "
      "{:.2f}; "
      "{:.1f} ms a frame, p99 {:.1f} ms\n",
      errors.localized,
      errors.frames,
      FormatAccuracy(errors),
      errors.wrong_10m,
      errors.sigma_rank_correlation,
      errors.median_ms,
      errors.p99_ms);
}

struct TrainCommand {
  FrameSelection frames;  ///< Without the data set.
  std::vector<std::string> datasets;
  std::string out;
  std::string report;
  std::string input_check = "refuse";
  MapTrainingOptions options;
};

/// The frames of all data sets that the selection keeps.
Result<std::vector<SelectedFrames>> SelectDrives(const std::vector<std::string>& datasets,
                                                 FrameSelection selection) {
  const bool selects = !selection.split.empty() || !selection.frames.empty();
  if (datasets.size() > 1 && selects) {
    return Error{
        ErrorKind::kInvalidInput,
        fmt::format("--split and --frames go with one --dataset, not with {}", datasets.size())};
  }
  std::vector<SelectedFrames> drives;
  for (const std::string& dataset : datasets) {
    selection.dataset = dataset;
    auto selected = SelectFrames(selection, SplitPart::kTrain);
    if (!selected) return std::move(selected).error();
    drives.push_back(std::move(*selected));
  }
  return drives;
}

struct CheckCommand {
  FrameSelection frames;  ///< Without the data set.
  std::vector<std::string> datasets;
  int threads = 2;
};

Result<int> Check(const CheckCommand& command) {
  const auto drives = SelectDrives(command.datasets, command.frames);
  if (!drives) return drives.error();
  return PrintChecks(*drives, command.threads) ? kExitOk : kExitConfig;
}

Result<int> Train(const TrainCommand& command) {
  const auto gate = ParseInputGate(command.input_check);
  if (!gate) return gate.error();
  const auto selected = SelectDrives(command.datasets, command.frames);
  if (!selected) return selected.error();
  const std::vector<SelectedFrames>& drives = *selected;
  if (auto checked = CheckDrives(drives, *gate, command.options.threads); !checked) {
    return checked.error();
  }
  MapTrainingOptions options = command.options;
  options.resumable_path = command.out;
  auto trained = TrainMap(drives, options);
  if (!trained) return std::move(trained).error();
  if (auto written = WriteMap(trained->map, command.out); !written) return written.error();
  if (trained->folder) trained->folder->Remove();
  const TrainingReport report = MakeTrainingReport(*trained, options);
  fmt::print("{}", FormatTrainingReport(report));
  if (command.report.empty()) return kExitOk;
  const auto page = FormatTrainingReportHtml(report);
  if (!page) return page.error();
  std::error_code failed;
  std::filesystem::create_directories(command.report, failed);  // what fails shows on writing
  for (const auto& [name, text] :
       {std::pair<std::string, std::string>{"/report.txt", FormatTrainingReport(report)},
        {"/report.html", *page},
        {"/held_out_poses.csv", FormatPoses(trained->map, trained->localizations)}}) {
    if (auto written = WriteFileAtomically(command.report + name, text); !written) {
      return written.error();
    }
  }
  return kExitOk;
}

struct CalibrateCommand {
  std::vector<std::string> datasets;
  FrameSelection frames;  ///< Without the data set.
  std::string map;
  std::string out;
  int held_out_every = MapTrainingOptions{}.held_out_every;
  int threads = 2;
};

Result<int> Calibrate(const CalibrateCommand& command) {
  auto map = ReadMap(command.map);
  if (!map) return map.error();
  const auto drives = SelectDrives(command.datasets, command.frames);
  if (!drives) return drives.error();
  const auto route = PlaceOnRoute(*drives, command.held_out_every);
  if (!route) return route.error();
  std::vector<DatasetFrame> held_out;
  for (const RouteFrame& frame : *route) {
    if (frame.is_held_out) held_out.push_back(frame.frame);
  }
  if (auto done = CalibrateRegions(*route, command.threads, *map); !done) return done.error();
  const auto localizations = LocalizeFrames(*map, held_out, command.threads);
  if (!localizations) return localizations.error();
  if (auto written = WriteMap(*map, command.out); !written) return written.error();
  fmt::print("{}", FormatErrors(MeasureErrors(*map, *localizations)));
  return kExitOk;
}

struct LocalizeCommand {
  FrameSelection frames;
  std::string map;
  std::string out;
  std::string disturbance = "none";
  bool fits_size = false;
  int threads = 1;
};

Result<int> Localize(const LocalizeCommand& command) {
  const auto disturbance = ParseDisturbance(command.disturbance);
  if (!disturbance) return disturbance.error();
  const auto map = ReadMap(command.map);
  if (!map) return map.error();
  const auto selected = SelectFrames(command.frames, SplitPart::kTest);
  if (!selected) return selected.error();
  if (!command.fits_size) {
    if (auto same = CheckCamera(*map, command.map, selected->dataset); !same) return same.error();
  }
  const auto change = [&](const GrayImage& image, int index) {
    const GrayImage fitted =
        command.fits_size ? FitSize(image, map->camera.width, map->camera.height) : image;
    return Disturb(fitted, *disturbance, static_cast<std::uint64_t>(index));
  };
  const auto localizations =
      LocalizeFrames(*map, selected->dataset.frames, command.threads, change);
  if (!localizations) return localizations.error();
  if (auto written = WriteFileAtomically(command.out, FormatPoses(*map, *localizations));
      !written) {
    return written.error();
  }
  fmt::print("{}", FormatErrors(MeasureErrors(*map, *localizations)));
  return kExitOk;
}

std::string FormatInfo(const SceneMap& map) {
  const TrainingSummary& training = map.training;
  std::string text = fmt::format(
      "id        {}\n"
      "format    {}\n"
      "camera    {} x {} px, f {:.2f} {:.2f}, centre {:.2f} {:.2f}\n"
      "features  {} octaves at {} x {} px, every {} px, {} -> {} dimensions, {} cells an image\n"
      "training  {} frames of {}, seed {}, program {}\n"
      "held out  {} frames: median {:.3f} m {:.3f} deg, p95 {:.3f} m, within 1 m {:.1f} %\n",
      map.id,
      kMapFormatVersion,
      map.camera.width,
      map.camera.height,
      map.camera.fx,
      map.camera.fy,
      map.camera.cx,
      map.camera.cy,
      map.features.octaves,
      map.features.working_width,
      map.features.working_height,
      map.features.cell_stride,
      map.whitening.inputs,
      map.whitening.outputs,
      map.cells_per_image,
      training.training_frames,
      training.dataset,
      training.seed,
      training.program_version,
      training.held_out_frames,
      training.median_error_m,
      training.median_error_rad * kDegrees,
      training.p95_error_m,
      100.0 * training.within_1m);
  for (const MapRegion& region : map.regions) {
    text += fmt::format(
        "{}   {} blocks of {}, around ({:.1f}, {:.1f}, {:.1f}) m, {} training poses, covariance "
        "factor {:.1f}, confidence threshold {:.3f}\n",
        region.name,
        region.head.shape.blocks,
        region.head.shape.width,
        region.head.centre_W.x(),
        region.head.centre_W.y(),
        region.head.centre_W.z(),
        region.training_poses.size(),
        region.calibration.covariance_factor,
        region.calibration.confidence_threshold);
  }
  return text;
}

/// As a JSON string: quoted, with what must be escaped escaped.
std::string Quoted(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') {
      quoted += '\\';
      quoted += c;
    } else if (static_cast<unsigned char>(c) < 0x20U) {
      quoted += fmt::format("\\u{:04x}", static_cast<unsigned>(c));
    } else {
      quoted += c;
    }
  }
  return quoted + '"';
}

std::string FormatInfoJson(const SceneMap& map) {
  const TrainingSummary& training = map.training;
  std::string regions;
  for (const MapRegion& region : map.regions) {
    regions += fmt::format(
        R"({}{{"name": {}, "training_poses": {}, "covariance_factor": {}, "confidence_threshold": {}}})",
        regions.empty() ? "" : ", ",
        Quoted(region.name),
        region.training_poses.size(),
        region.calibration.covariance_factor,
        region.calibration.confidence_threshold);
  }
  return fmt::format(
      R"({{"id": "{}", "format_version": {}, "image_width": {}, "image_height": {}, "dataset": {}, )"
      R"("seed": {}, "training_frames": {}, "held_out_frames": {}, )"
      R"("median_error_m": {}, "median_error_rad": {}, "p95_error_m": {}, "within_1m": {}, )"
      R"("regions": [{}]}})"
      "\n",
      map.id,
      kMapFormatVersion,
      map.camera.width,
      map.camera.height,
      Quoted(training.dataset),
      training.seed,
      training.training_frames,
      training.held_out_frames,
      training.median_error_m,
      training.median_error_rad,
      training.p95_error_m,
      training.within_1m,
      regions);
}

Result<int> Info(const std::string& path, bool json) {
  const auto map = ReadMap(path);
  if (!map) return map.error();
  fmt::print("{}", json ? FormatInfoJson(*map) : FormatInfo(*map));
  return kExitOk;
}

int Finish(const Result<int>& result) {
  if (result) return *result;
  fmt::print(stderr, "reloc map: {}\n", result.error().message);
  return ExitCode(result.error());
}

void AddFrameOptions(CLI::App& command, FrameSelection& frames, const char* split_help) {
  command.add_option("--split", frames.split, split_help);
  command.add_option("--frames", frames.frames, "A:B, only frames with these indices");
}

CLI::App* AddCheck(CLI::App& app, CheckCommand& options) {
  auto* command =
      app.add_subcommand("check", "whether a data set can make a good map, and why not");
  command
      ->add_option(
          "--dataset", options.datasets, "folder of a data set; more than one may be given")
      ->required();
  AddFrameOptions(*command, options.frames, "file of the split: its train rows are checked");
  command->add_option("--threads", options.threads, "default 2");
  return command;
}

CLI::App* AddTrain(CLI::App& app, TrainCommand& options) {
  auto* command = app.add_subcommand("train", "make a map of a data set");
  command
      ->add_option("--dataset",
                   options.datasets,
                   "folder of the data set; more than one are drives along the route of the first")
      ->required();
  AddFrameOptions(*command, options.frames, "file of the split: its train rows are used");
  command->add_option("--out", options.out, "the map file to write")->required();
  command->add_option("--threads", options.options.threads, "default 2");
  command->add_option("--seed", options.options.seed, "default 1");
  command->add_option("--report", options.report, "folder for a report on held-out frames");
  command->add_option("--input-check",
                      options.input_check,
                      "what follows from a bad data set: refuse (default), warn, off");
  command->add_option("--iterations", options.options.head.iterations, "steps for each region");
  command->add_option("--checkpoint-every",
                      options.options.checkpoint_every_s,
                      "seconds after which a region in training is kept in OUT.partial, from which "
                      "the same command goes on; default 30");
  command->add_option("--views", options.options.cells.views_per_image, "changed copies an image");
  command->add_option("--held-out-every", options.options.held_out_every, "default 8");
  command->add_option("--region-length", options.options.region_length_m, "default 150 m");
  return command;
}

CLI::App* AddCalibrate(CLI::App& app, CalibrateCommand& options) {
  auto* command = app.add_subcommand(
      "calibrate", "measure anew how far a map's covariances and confidences can be trusted");
  command->add_option("--map", options.map, "the map file")->required();
  command->add_option("--dataset", options.datasets, "as given to train, in this order")
      ->required();
  AddFrameOptions(*command, options.frames, "file of the split: its train rows are used");
  command->add_option("--held-out-every",
                      options.held_out_every,
                      "as given to train: the frames that it did not learn from");
  command->add_option("--out", options.out, "the map file to write")->required();
  command->add_option("--threads", options.threads, "default 2");
  return command;
}

CLI::App* AddLocalize(CLI::App& app, LocalizeCommand& options) {
  auto* command = app.add_subcommand("localize", "find the images of a data set in a map");
  command->add_option("--map", options.map, "the map file")->required();
  command->add_option("--dataset", options.frames.dataset, "folder of the data set")->required();
  AddFrameOptions(*command, options.frames, "file of the split: its test rows are used");
  command->add_option("--out", options.out, "poses.csv to write")->required();
  command->add_option("--threads", options.threads, "default 1; each has an image of its own");
  command->add_option("--disturb",
                      options.disturbance,
                      "gamma, dark, blur, noise or occluders: what is done to the images first");
  command->add_flag("--fit-size",
                    options.fits_size,
                    "cut and resize images of another camera, to see that they are not found");
  return command;
}

int Main(int argc, char** argv) {
  CLI::App app("Makes a map of a recorded drive, and finds images in it.", "reloc map");
  app.require_subcommand(1);
  CheckCommand check;
  const CLI::App* check_app = AddCheck(app, check);
  TrainCommand train;
  const CLI::App* train_app = AddTrain(app, train);
  CalibrateCommand calibrate;
  const CLI::App* calibrate_app = AddCalibrate(app, calibrate);
  LocalizeCommand localize;
  const CLI::App* localize_app = AddLocalize(app, localize);

  std::string map_path;
  bool json = false;
  auto* info_app = app.add_subcommand("info", "what is in a map");
  info_app->add_option("map", map_path, "the map file")->required();
  info_app->add_flag("--json", json, "for scripts");

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kExitOk : kExitUsage;
  }
  if (check_app->parsed()) return Finish(Check(check));
  if (train_app->parsed()) return Finish(Train(train));
  if (calibrate_app->parsed()) return Finish(Calibrate(calibrate));
  if (localize_app->parsed()) return Finish(Localize(localize));
  return Finish(Info(map_path, json));
}

}  // namespace
}  // namespace relocd

int main(int argc, char** argv) {
  // Blocks of features come and go by the megabyte. Given back to the system at once, they leave no
  // holes: a region's training takes 0.7 GB instead of 1.1 GB.
  constexpr int kLargeBlock = 1 << 20;
  ::mallopt(M_MMAP_THRESHOLD, kLargeBlock);
  return relocd::Main(argc, argv);
}
