#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include <fmt/core.h>

#include "camera/dataset.h"
#include "camera/jpeg.h"
#include "core/file.h"
#include "geometry/trajectory.h"
#include "sim_commands.h"
#include "simulation/frame_renderer.h"
#include "simulation/session.h"
#include "simulation/world.h"

// reloc sim again: some places of a drive, as another session has them.

namespace relocd {
namespace {

struct Options {
  std::string drive;
  std::string world = "campus";
  std::uint64_t seed = 7;
  std::string session = "noon";
  std::size_t count = 8;
  int samples = 4;
  std::string out;
};

/// `count` of the frames, each in the middle of its share: those that a report of the drive shows.
std::vector<const DatasetFrame*> EvenlySpaced(const Dataset& drive, std::size_t count) {
  const std::size_t size = drive.frames.size();
  const std::size_t chosen = std::min(size, count);
  std::vector<const DatasetFrame*> frames;
  for (std::size_t i = 0; i < chosen; ++i)
    frames.push_back(&drive.frames[(2 * i + 1) * size / (2 * chosen)]);
  return frames;
}

/// A camera that stands long enough for its exposure to settle.
RgbImage Picture(FrameRenderer& renderer, const DatasetFrame& frame) {
  constexpr int kBefore = 3;
  constexpr std::int64_t kApart_ns = 100'000'000;
  const auto stands = [&frame](std::int64_t /*time_ns*/) { return frame.X_WC; };
  for (int i = kBefore; i > 0; --i)
    renderer.Render(frame.time_ns - i * kApart_ns, stands);
  return renderer.Render(frame.time_ns, stands);
}

Result<void> WriteTexts(const Options& options, const std::vector<const DatasetFrame*>& frames) {
  std::string names;
  Trajectory3 X_WCs;
  for (const DatasetFrame* const frame : frames) {
    names += fmt::format("{:06}.jpg\n", frame->index);
    X_WCs.push_back({.time_ns = frame->time_ns, .X_WB = frame->X_WC});
  }
  const auto intrinsics = ReadFile(options.drive + "/intrinsics.txt");
  if (!intrinsics) return intrinsics.error();
  if (auto ok = WriteFileAtomically(options.out + "/frames.txt", names); !ok) return ok;
  const std::string poses = FormatTumTrajectory(X_WCs);
  if (auto ok = WriteFileAtomically(options.out + "/poses_tum.txt", poses); !ok) return ok;
  return WriteFileAtomically(options.out + "/intrinsics.txt", *intrinsics);
}

Result<void> RenderAgain(const Options& options) {
  const auto drive = ReadDataset(options.drive);
  if (!drive) return drive.error();
  const auto session = ParseSession(options.session);
  if (!session) return session.error();
  const auto world = MakeWorld(options.world, options.seed);
  if (!world) return world.error();
  FrameRendererOptions camera{.intrinsics = drive->intrinsics};
  camera.samples_per_pixel = options.samples;
  camera.threads = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  const auto renderer = FrameRenderer::Create(*world, *session, camera);
  if (!renderer) return renderer.error();
  std::error_code error;
  std::filesystem::create_directories(options.out, error);
  if (error) {
    return Error{ErrorKind::kUnavailable,
                 fmt::format("creating {}: {}", options.out, error.message())};
  }
  const auto frames = EvenlySpaced(*drive, options.count);
  for (const DatasetFrame* const frame : frames) {
    constexpr int kQuality = 90;
    const auto jpeg = EncodeRgbToJpeg(Picture(**renderer, *frame), kQuality);
    if (!jpeg) return jpeg.error();
    const std::string bytes(jpeg->begin(), jpeg->end());
    const std::string path = fmt::format("{}/{:06}.jpg", options.out, frame->index);
    if (auto ok = WriteFileAtomically(path, bytes); !ok) return ok;
  }
  return WriteTexts(options, frames);
}

}  // namespace

void AddSimAgain(CLI::App& app, SimCommand& command) {
  const auto options = std::make_shared<Options>();  // lives as long as the parser's callback
  CLI::App& again =
      *app.add_subcommand("again", "some places of a drive, as another session has them");
  again.add_option("--drive", options->drive, "the drive's folder")->required();
  again.add_option("--world", options->world, "the drive's: campus, torcs:TRACK")
      ->capture_default_str();
  again.add_option("--seed", options->seed, "the drive's")->capture_default_str();
  again.add_option("--session", options->session, "the other conditions")->capture_default_str();
  again.add_option("--count", options->count, "of places, evenly over the drive")
      ->capture_default_str()
      ->check(CLI::Range(1, 10000));
  again.add_option("--samples", options->samples, "a pixel")
      ->capture_default_str()
      ->check(CLI::Range(1, 256));
  again.add_option("--out", options->out, "a data set of these images")->required();
  again.callback([options, &command] { command = [options] { return RenderAgain(*options); }; });
}

}  // namespace relocd
