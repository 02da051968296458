#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <numbers>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <fmt/core.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/file.h"
#include "geometry/pose3.h"
#include "sim_commands.h"
#include "simulation/frame_renderer.h"
#include "simulation/session.h"
#include "simulation/world.h"

// reloc sim view: what a world looks like, from the driver's place or from above.

namespace relocd {
namespace {

struct Options {
  std::string world = "campus";
  std::uint64_t seed = 7;
  std::string session = "noon";
  double along_m = 0.0;
  double left_m = 0.0;
  double height_m = 1.5;
  double yaw_deg = 0.0;
  double pitch_deg = 0.0;
  double fov_deg = 90.0;
  std::array<int, 2> size{640, 480};
  int samples = 4;
  bool from_above = false;
  std::string out;
};

constexpr double Radians(double degrees) {
  return degrees * std::numbers::pi / 180.0;
}

/// The place on a path at a distance along it, x ahead.
Pose2 PlaceOn(const Path& path, double along_m) {
  const std::size_t count = path.points.size();
  const std::size_t last = path.is_closed ? count : count - 1;
  double passed_m = 0.0;
  for (std::size_t i = 0; i < last; ++i) {
    const Eigen::Vector2d step = path.points[(i + 1) % count] - path.points[i];
    const double length_m = step.norm();
    if (passed_m + length_m >= along_m || i + 1 == last) {
      const Eigen::Vector2d at =
          path.points[i] + std::min(1.0, (along_m - passed_m) / length_m) * step;
      return {at.x(), at.y(), std::atan2(step.y(), step.x())};
    }
    passed_m += length_m;
  }
  return {};
}

/// A camera on the route.
Pose3 DriverView(const World& world, const Options& options) {
  const Pose2 X_WR = PlaceOn(world.route, options.along_m) * Pose2(0.0, options.left_m, 0.0);
  const double ground_m = world.ground->HeightAlong(X_WR.translation(), X_WR.yaw());
  const Pose3 X_WB(RotationFromRollPitchYaw(
                       0.0, -Radians(options.pitch_deg), X_WR.yaw() + Radians(options.yaw_deg)),
                   {X_WR.x(), X_WR.y(), ground_m + options.height_m});
  const Pose3 X_BC(RotationFromRollPitchYaw(-std::numbers::pi / 2.0, 0.0, -std::numbers::pi / 2.0),
                   Eigen::Vector3d::Zero());
  return X_WB * X_BC;
}

/// What a view from above shows of the plane.
struct Extent {
  Eigen::Vector2d low;
  Eigen::Vector2d high;
};

Extent ExtentOfRoute(const Path& route, const std::array<int, 2>& size) {
  constexpr double kMarginM = 25.0;
  Extent extent{route.points.front(), route.points.front()};
  for (const Eigen::Vector2d& point : route.points) {
    extent.low = extent.low.cwiseMin(point);
    extent.high = extent.high.cwiseMax(point);
  }
  const Eigen::Vector2d middle = 0.5 * (extent.low + extent.high);
  Eigen::Vector2d half = 0.5 * (extent.high - extent.low).array() + kMarginM;
  const double aspect = static_cast<double>(size[0]) / size[1];
  half = {std::max(half.x(), half.y() * aspect), std::max(half.y(), half.x() / aspect)};
  return {middle - half, middle + half};
}

/// From so high that lines of sight are nearly parallel. x is to the right and y up in the picture.
constexpr double kViewHeightM = 3000.0;

Pose3 ViewFromAbove(const World& world, const Extent& extent) {
  const Eigen::Vector2d middle = 0.5 * (extent.low + extent.high);
  return {RotationFromRollPitchYaw(std::numbers::pi, 0.0, 0.0),
          {middle.x(), middle.y(), world.ground->HeightAt(middle) + kViewHeightM}};
}

Result<void> WriteImage(const std::string& path, const RgbImage& image) {
  cv::Mat bgr;
  const cv::Mat rgb(image.height,
                    image.width,
                    CV_8UC3,
                    const_cast<std::uint8_t*>(image.pixels.data()));  // NOLINT
  cv::cvtColor(rgb, bgr, cv::COLOR_RGB2BGR);
  std::vector<std::uint8_t> bytes;
  const std::string ending = path.substr(std::min(path.rfind('.'), path.size()));
  if (ending != ".png" && ending != ".jpg") {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("--out is {}, must end with .png or .jpg", path)};
  }
  cv::imencode(ending, bgr, bytes);
  return WriteFileAtomically(path, std::string(bytes.begin(), bytes.end()));
}

Result<void> CheckOptions(const Options& options) {
  const auto invalid = [](const char* name, double value, const char* allowed) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("{} is {}, must be {}", name, value, allowed)};
  };
  if (!(options.fov_deg >= 5.0 && options.fov_deg <= 140.0))
    return invalid("--fov-deg", options.fov_deg, "in [5, 140]");
  for (const int side : options.size) {
    if (side < 16 || side > 4096) return invalid("--size", side, "16 to 4096 on each side");
  }
  return {};
}

Result<void> View(const Options& options) {
  if (auto ok = CheckOptions(options); !ok) return ok;
  auto session = ParseSession(options.session);
  if (!session) return std::move(session).error();
  auto world = MakeWorld(options.world, options.seed);
  if (!world) return std::move(world).error();
  const Extent extent = ExtentOfRoute(world->route, options.size);
  FrameRendererOptions camera;
  const double focal = options.from_above
                           ? options.size[0] * kViewHeightM / (extent.high.x() - extent.low.x())
                           : 0.5 * options.size[0] / std::tan(0.5 * Radians(options.fov_deg));
  camera.intrinsics = {.fx = focal,
                       .fy = focal,
                       .cx = 0.5 * (options.size[0] - 1),
                       .cy = 0.5 * (options.size[1] - 1),
                       .width = options.size[0],
                       .height = options.size[1]};
  camera.samples_per_pixel = options.samples;
  camera.threads = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  if (options.from_above) session->haze_per_m = 0.0;
  auto renderer = FrameRenderer::Create(*world, *session, camera);
  if (!renderer) return std::move(renderer).error();
  const Pose3 X_WC =
      options.from_above ? ViewFromAbove(*world, extent) : DriverView(*world, options);
  const RgbImage image = (*renderer)->Render(0, [&X_WC](std::int64_t) { return Pose3(X_WC); });
  if (auto ok = WriteImage(options.out, image); !ok) return ok;
  if (options.from_above) {
    fmt::print("{:.3f},{:.3f},{:.3f},{:.3f}\n",
               extent.low.x(),
               extent.low.y(),
               extent.high.x(),
               extent.high.y());
  }
  return {};
}

}  // namespace

void AddSimView(CLI::App& app, SimCommand& command) {
  const auto options = std::make_shared<Options>();  // lives as long as the parser's callback
  CLI::App& view = *app.add_subcommand("view", "one picture of a world");
  view.add_option("--world", options->world, "campus, torcs:TRACK")->capture_default_str();
  view.add_option("--seed", options->seed, "of procedural worlds")->capture_default_str();
  view.add_option("--session", options->session, "its conditions")->capture_default_str();
  view.add_option("--at-m", options->along_m, "how far along the route")->capture_default_str();
  view.add_option("--left-m", options->left_m, "to the left of it")->capture_default_str();
  view.add_option("--height-m", options->height_m, "above the ground")->capture_default_str();
  view.add_option("--yaw-deg", options->yaw_deg, "to the left of ahead")->capture_default_str();
  view.add_option("--pitch-deg", options->pitch_deg, "upwards")->capture_default_str();
  view.add_option("--fov-deg", options->fov_deg, "from left to right")->capture_default_str();
  view.add_option("--size", options->size, "of the picture, px: 640x480")
      ->delimiter('x')
      ->capture_default_str();
  view.add_option("--samples", options->samples, "a pixel")->capture_default_str();
  view.add_flag("--from-above",
                options->from_above,
                "the whole route from above; prints left,bottom,right,top in m");
  view.add_option("--out", options->out, "a .png or .jpg file")->required();
  view.callback([options, &command] { command = [options] { return View(*options); }; });
}

}  // namespace relocd
