#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <limits>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "camera/image.h"
#include "camera/jpeg.h"
#include "core/exit_code.h"
#include "core/file.h"
#include "geometry/planar.h"
#include "geometry/trajectory.h"

// make_street DIR: writes a small data set in the dataset layout, for tests that must run without
// recordings: a camera drives down a street of textured boxes. Each image is cast ray by ray; all
// of it follows from constants and integer hashes.

namespace relocd {
namespace {

constexpr int kWidth = 416;
constexpr int kHeight = 160;
constexpr double kFocal = 240.0;
constexpr int kFrames = 150;
constexpr double kFramePeriod_s = 0.1;
constexpr double kSpeed_mps = 4.0;
constexpr double kCameraHeight_m = 1.65;
constexpr double kCameraForward_m = 1.03;

double Hash(std::int64_t x, std::int64_t y, std::uint64_t seed) {
  std::uint64_t h = seed * 0x9E3779B97F4A7C15ULL +
                    static_cast<std::uint64_t>(x) * 0xBF58476D1CE4E5B9ULL +
                    static_cast<std::uint64_t>(y) * 0x94D049BB133111EBULL;
  h ^= h >> 31;
  h *= 0xD6E8FEB86659FD93ULL;
  h ^= h >> 32;
  return static_cast<double>(h >> 11) / static_cast<double>(1ULL << 53);
}

/// Smooth noise of wavelength 1 in [0, 1].
double Noise(double x, double y, std::uint64_t seed) {
  const double fx = std::floor(x);
  const double fy = std::floor(y);
  const auto ix = static_cast<std::int64_t>(fx);
  const auto iy = static_cast<std::int64_t>(fy);
  const double u = (x - fx) * (x - fx) * (3.0 - 2.0 * (x - fx));
  const double v = (y - fy) * (y - fy) * (3.0 - 2.0 * (y - fy));
  const double top = std::lerp(Hash(ix, iy, seed), Hash(ix + 1, iy, seed), u);
  const double bottom = std::lerp(Hash(ix, iy + 1, seed), Hash(ix + 1, iy + 1, seed), u);
  return std::lerp(top, bottom, v);
}

/// Gray in [0, 255] of a surface point; what is finer than a pixel's footprint is left out.
double Texture(double u_m, double v_m, double footprint_m, std::uint64_t seed) {
  double gray = 0.5;
  double amplitude = 0.9;
  for (const double wavelength_m : {3.1, 1.3, 0.55, 0.23, 0.1}) {
    if (wavelength_m < 3.0 * footprint_m) break;
    gray += amplitude * (Noise(u_m / wavelength_m, v_m / wavelength_m, ++seed) - 0.5);
    amplitude *= 0.8;
  }
  return 255.0 * std::clamp(gray, 0.0, 1.0);
}

struct Box {
  Eigen::Vector3d low;
  Eigen::Vector3d high;
};

struct Hit {
  double distance = std::numeric_limits<double>::infinity();
  int axis = 2;
  std::uint64_t seed = 1;
};

/// The slab method.
void Intersect(const Eigen::Vector3d& origin,
               const Eigen::Vector3d& direction,
               const Box& box,
               std::uint64_t seed,
               Hit& hit) {
  double enter = 0.0;
  double leave = hit.distance;
  int axis = 0;
  for (int i = 0; i < 3; ++i) {
    const double inverse = 1.0 / direction[i];
    double near = (box.low[i] - origin[i]) * inverse;
    double far = (box.high[i] - origin[i]) * inverse;
    if (near > far) std::swap(near, far);
    if (near > enter) {
      enter = near;
      axis = i;
    }
    leave = std::min(leave, far);
  }
  if (enter > 0.0 && enter < leave)
    hit = {.distance = enter, .axis = axis, .seed = seed * 16 + static_cast<std::uint64_t>(axis)};
}

std::vector<Box> MakeStreet() {
  std::vector<Box> boxes;
  for (int i = 0; i < 24; ++i) {
    const double x = -10.0 + 5.0 * i;
    for (const double side : {-1.0, 1.0}) {
      const std::uint64_t seed = static_cast<std::uint64_t>(2 * i) + (side > 0.0 ? 1 : 0);
      const double depth = 5.0 + 5.0 * Hash(i, 1, seed);
      const double length = 3.0 + 2.0 * Hash(i, 2, seed);
      const double height = 2.5 + 6.0 * Hash(i, 3, seed);
      const double near = side * depth;
      const double far = side * (depth + 6.0);
      boxes.push_back({{x, std::min(near, far), 0.0}, {x + length, std::max(near, far), height}});
    }
  }
  boxes.push_back({{112.0, -40.0, 0.0}, {120.0, 40.0, 14.0}});
  return boxes;
}

/// A swerving drive along x.
Pose2 BodyPoseAt(double t_s) {
  const double x = kSpeed_mps * t_s;
  const double y = 1.5 * std::sin(0.12 * x);
  return {x, y, std::atan(1.5 * 0.12 * std::cos(0.12 * x))};
}

GrayImage Render(const Pose3& X_WC, const std::vector<Box>& boxes) {
  GrayImage image{.width = kWidth, .height = kHeight, .pixels = {}};
  image.pixels.reserve(static_cast<std::size_t>(kWidth * kHeight));
  const Eigen::Vector3d origin = X_WC.translation();
  for (int v = 0; v < kHeight; ++v) {
    for (int u = 0; u < kWidth; ++u) {
      const Eigen::Vector3d p_C(
          (u - 0.5 * (kWidth - 1)) / kFocal, (v - 0.5 * (kHeight - 1)) / kFocal, 1.0);
      const Eigen::Vector3d direction = X_WC.rotation() * p_C;
      Hit hit;
      if (direction.z() < -1e-6) hit.distance = -origin.z() / direction.z();
      std::uint64_t seed = 100;
      for (const Box& box : boxes)
        Intersect(origin, direction, box, ++seed, hit);
      double gray = 235.0;  // sky
      if (std::isfinite(hit.distance)) {
        const Eigen::Vector3d p_W = origin + hit.distance * direction;
        const int first = hit.axis == 0 ? 1 : 0;
        const int second = hit.axis == 2 ? 1 : 2;
        gray = Texture(p_W[first], p_W[second], hit.distance / kFocal, hit.seed);
      }
      image.pixels.push_back(static_cast<std::uint8_t>(gray));
    }
  }
  return image;
}

Result<void> WriteStreet(const std::string& directory) {
  std::filesystem::create_directories(directory + "/images");
  const Pose3 X_BC(RotationFromRollPitchYaw(-std::numbers::pi / 2.0, 0.0, -std::numbers::pi / 2.0),
                   {kCameraForward_m, 0.0, kCameraHeight_m});
  const std::vector<Box> boxes = MakeStreet();
  Trajectory3 poses;
  std::string frames;
  std::string planar = "t_s,x_m,y_m,theta_rad\n";
  std::string split;
  for (int i = 0; i < kFrames; ++i) {
    const double t_s = i * kFramePeriod_s;
    const Pose3 X_WC = LiftFromPlane(BodyPoseAt(t_s)) * X_BC;
    const std::string name = fmt::format("images/{:06}.jpg", i);
    constexpr int kQuality = 92;
    auto jpeg = EncodeGrayToJpeg(Render(X_WC, boxes), kQuality);
    if (!jpeg) return std::move(jpeg).error();
    const std::string bytes(jpeg->begin(), jpeg->end());
    if (auto ok = WriteFileAtomically(directory + "/" + name, bytes); !ok) return ok;
    frames += name + "\n";
    split += fmt::format("{} {} {}\n", i, name, i % 5 == 2 ? "test" : "train");
    poses.push_back({std::llround(t_s * 1e9), X_WC});
    const Eigen::Vector3d& p = X_WC.translation();
    planar +=
        fmt::format("{:.6f},{:.9f},{:.9f},{:.9f}\n", t_s, p.x(), p.y(), BodyPoseAt(t_s).yaw());
  }
  const std::array<std::pair<std::string, std::string>, 5> files{{
      {"frames.txt", frames},
      {"poses_tum.txt", FormatTumTrajectory(poses)},
      {"planar_truth.csv", planar},
      {"split_every5.txt", split},
      {"intrinsics.txt",
       fmt::format("{} {} {} {} {} {}\n",
                   kFocal,
                   kFocal,
                   0.5 * (kWidth - 1),
                   0.5 * (kHeight - 1),
                   kWidth,
                   kHeight)},
  }};
  for (const auto& [name, text] : files) {
    if (auto ok = WriteFileAtomically(directory + "/" + name, text); !ok) return ok;
  }
  return {};
}

}  // namespace
}  // namespace relocd

int main(int argc, char** argv) {
  if (argc != 2) {
    fmt::print(stderr, "usage: make_street DIR\n");
    return relocd::kExitUsage;
  }
  const auto ok = relocd::WriteStreet(argv[1]);
  if (ok) return relocd::kExitOk;
  fmt::print(stderr, "make_street: {}\n", ok.error().message);
  return relocd::ExitCode(ok.error());
}
