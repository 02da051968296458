#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <map>
#include <memory>
#include <numbers>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "camera/bounded_jpeg_encoder.h"
#include "config/config.h"
#include "core/file.h"
#include "depth_file.h"
#include "progress_line.h"
#include "sim_commands.h"
#include "sim_live.h"
#include "simulation/drive_plan.h"
#include "simulation/drive_writer.h"
#include "simulation/frame_renderer.h"
#include "simulation/session.h"
#include "simulation/vehicle_body.h"
#include "simulation/wheel_simulator.h"
#include "simulation/world.h"

// reloc sim: a drive through a world, as a data set with its truth.

namespace relocd {
namespace {

struct Options {
  std::string command_line;

  std::string world = "campus";
  std::uint64_t seed = 7;
  std::string session = "noon";
  std::optional<std::uint64_t> drive_seed{};
  std::string vehicle;
  std::string out;

  std::string camera = "front";
  double frame_rate_hz = 8.0;
  std::string size = "640x480";
  double fov_deg = 90.0;
  std::vector<double> distortion{};
  double exposure_ms = 8.0;
  double rolling_shutter_ms = 0.0;
  int samples = 4;
  int threads = 0;
  bool no_images = false;
  bool depth = false;

  DrivePlanOptions plan;
  VehicleBodyOptions body;
  VehicleGeometry geometry;
  double track_error = 0.002;
  bool no_wheel_errors = false;
  WheelSimulationOptions wheels{.radius_sigma = 1e-4,
                                .traction_slip_per_mps2 = 0.002,
                                .turn_slip_per_mps2 = 0.0002,
                                .yaw_rate_bias_radps = 0.002,
                                .yaw_rate_noise_radps = 0.001};
  LiveOptions live;

  bool list_sessions = false;
  bool list_worlds = false;
};

Error Invalid(std::string message) {
  return {ErrorKind::kInvalidInput, std::move(message)};
}

Result<void> CheckRange(const char* name, double value, double low, double high) {
  if (value >= low && value <= high) return {};
  return Invalid(fmt::format("{} is {}, must be in [{}, {}]", name, value, low, high));
}

Result<CameraIntrinsics> MakeIntrinsics(const Options& options) {
  CameraIntrinsics camera;
  int used = 0;
  const bool is_read =
      std::sscanf(options.size.c_str(), "%dx%d%n", &camera.width, &camera.height, &used) == 2 &&
      used == static_cast<int>(options.size.size());
  if (!is_read || camera.width < 16 || camera.height < 16) {
    return Invalid(
        fmt::format("--size is '{}', must be WIDTHxHEIGHT, each at least 16", options.size));
  }
  if (auto ok = CheckRange("--fov-deg", options.fov_deg, 5.0, 150.0); !ok) {
    return std::move(ok).error();
  }
  const double half_rad = 0.5 * options.fov_deg * std::numbers::pi / 180.0;
  camera.fx = 0.5 * camera.width / std::tan(half_rad);
  camera.fy = camera.fx;
  camera.cx = 0.5 * (camera.width - 1);
  camera.cy = 0.5 * (camera.height - 1);
  std::copy(options.distortion.begin(), options.distortion.end(), camera.distortion.begin());
  if (auto ok = camera.Validate(); !ok) return std::move(ok).error().WithContext("--size");
  return camera;
}

/// Other for each session, so that its noise is not that of the drive that a map was learned from.
std::uint64_t DriveSeed(const Options& options) {
  if (options.drive_seed) return *options.drive_seed;
  std::uint32_t hash = 2166136261;  // FNV-1a
  for (const char character : fmt::format("{}/{}", options.seed, options.session))
    hash = (hash ^ static_cast<unsigned char>(character)) * 16777619U;
  return hash;
}

/// All that is known before a world is made, checked: making one takes a while.
struct Setup {
  Session session;
  Config vehicle;
  CameraConfig camera;
  DbcFile dbc;
  CameraIntrinsics intrinsics;
  std::uint64_t drive_seed = 0;
  bool with_depth = false;
  std::map<std::string, std::string> copies;  ///< Of the vehicle's files.
};

Result<void> CheckOptions(const Options& options) {
  if (auto ok = CheckRange("--frame-rate-hz", options.frame_rate_hz, 0.1, 120.0); !ok) return ok;
  if (auto ok = CheckRange("--track-error", options.track_error, -0.5, 0.5); !ok) return ok;
  if (auto ok = CheckRange("--wheelbase-m", options.geometry.wheelbase_m, 0.1, 20.0); !ok)
    return ok;
  if (auto ok = CheckRange("--exposure-ms", options.exposure_ms, 0.01, 100.0); !ok) return ok;
  if (auto ok = CheckRange("--rolling-shutter-ms", options.rolling_shutter_ms, 0.0, 100.0); !ok)
    return ok;
  if (auto ok = CheckRange("--samples", options.samples, 1, 1024); !ok) return ok;
  if (auto ok = CheckRange("--threads", options.threads, 0, 1024); !ok) return ok;
  if (options.no_images && !options.live.video.empty()) {
    return Invalid("--live-video needs images, must not be with --no-images");
  }
  if (auto ok = options.body.Validate(); !ok) return ok;
  if (auto ok = options.wheels.Validate(); !ok) return ok;
  return DriveWriter::Check(options.out);
}

/// The vehicle's files, under names under which they find each other.
Result<std::map<std::string, std::string>> CopyVehicle(const Options& options,
                                                       const Config& config) {
  auto yaml = ReadFile(options.vehicle);
  if (!yaml) return std::move(yaml).error();
  auto dbc = ReadFile(config.can.dbc_file);
  if (!dbc) return std::move(dbc).error();
  std::map<std::string, std::string> copies;
  copies["vehicle.yaml"] = *yaml;
  copies[std::filesystem::path(config.can.dbc_file).filename().string()] = *dbc;
  return copies;
}

Result<Setup> Prepare(const Options& options) {
  if (auto ok = CheckOptions(options); !ok) return std::move(ok).error();
  auto session = ParseSession(options.session);
  if (!session) return std::move(session).error();
  auto config = LoadConfig(options.vehicle, {});
  if (!config) return std::move(config).error();
  const auto camera = config->cameras.find(options.camera);
  if (camera == config->cameras.end()) {
    std::vector<std::string> names;
    for (const auto& [name, unused] : config->cameras)
      names.push_back(name);
    return Invalid(fmt::format("{}: has no camera '{}', --camera must be one of {}",
                               options.vehicle,
                               options.camera,
                               fmt::join(names, ", ")));
  }
  if (config->can.dbc_file.empty()) {
    return Invalid(fmt::format("{}: can.dbc_file is empty, must name a DBC file", options.vehicle));
  }
  auto dbc = DbcFile::Read(config->can.dbc_file);
  if (!dbc) return std::move(dbc).error();
  auto intrinsics = MakeIntrinsics(options);
  if (!intrinsics) return std::move(intrinsics).error();
  auto copies = CopyVehicle(options, *config);
  if (!copies) return std::move(copies).error();
  return Setup{.session = *session,
               .vehicle = *config,
               .camera = camera->second,
               .dbc = *dbc,
               .intrinsics = *intrinsics,
               .drive_seed = DriveSeed(options),
               .with_depth = options.depth,
               .copies = *copies};
}

std::string FormatSession(const Options& options, const Setup& setup, const DrivePlan& plan) {
  return fmt::format(
      "# A drive through a simulated world. Its command makes the same again.\n"
      "command: {}\nversion: {}\nworld: {}\nseed: {}\nsession: {}\ndrive_seed: {}\n"
      "vehicle: {}\ncamera: {}\nframe_rate_hz: {}\nduration_s: {:.3f}\nlength_m: {:.3f}\n",
      options.command_line,
      RELOCD_VERSION,
      options.world,
      options.seed,
      options.session,
      setup.drive_seed,
      options.vehicle,
      options.camera,
      options.frame_rate_hz,
      static_cast<double>(plan.duration_ns()) * 1e-9,
      plan.length_m());
}

WheelSimulationOptions WheelOptions(const Options& options, const Setup& setup) {
  WheelSimulationOptions wheels = options.wheels;
  if (options.no_wheel_errors) wheels = {.wheel_sigma_m_per_sqrt_m = 0.0};
  wheels.seed = setup.drive_seed;
  wheels.interface = setup.vehicle.can.interface;
  return wheels;
}

/// One drive through a world that is there.
class Drive {
 public:
  static Result<std::unique_ptr<Drive>> Create(const Options& options,
                                               const Setup& setup,
                                               const World& world) {
    DrivePlanOptions plan_options = options.plan;
    plan_options.seed = setup.drive_seed;
    auto plan = DrivePlan::Create(world.route, setup.session, plan_options);
    if (!plan) return std::move(plan).error().WithContext(options.world);
    return std::unique_ptr<Drive>(new Drive(options, setup, world, std::move(plan).value()));
  }

  /// All of it but the images.
  [[nodiscard]] Result<DriveRecord> Record() const {
    const WheelSimulationOptions wheels = WheelOptions(options_, setup_);
    VehicleGeometry geometry = geometry_;
    if (!options_.no_wheel_errors) geometry.track_m *= 1.0 + options_.track_error;
    DriveRecord record;
    record.camera = options_.camera;
    record.intrinsics = setup_.intrinsics;
    record.motions = RollWheels(plan_, *world_.ground, geometry, wheels.period_ns());
    auto frames = SimulateWheelFrames(record.motions, setup_.vehicle.odometry, setup_.dbc, wheels);
    if (!frames) return std::move(frames).error();
    record.can_frames = std::move(frames).value();
    record.can_interface = wheels.interface;
    record.texts = setup_.copies;
    record.texts["session.txt"] = FormatSession(options_, setup_, plan_);
    if (options_.no_images) return record;
    for (std::int64_t i = 0;; ++i) {
      const std::int64_t time_ns =
          std::llround(static_cast<double>(i) * 1e9 / options_.frame_rate_hz);
      if (time_ns > plan_.duration_ns()) return record;
      record.X_WCs.push_back({.time_ns = time_ns, .X_WB = CameraAt(time_ns)});
    }
  }

  [[nodiscard]] Pose3 CameraAt(std::int64_t time_ns) const { return body_.At(time_ns) * X_BC_; }

  [[nodiscard]] Result<std::unique_ptr<FrameRenderer>> MakeRenderer() const {
    const auto cores = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
    return FrameRenderer::Create(world_,
                                 setup_.session,
                                 {.intrinsics = setup_.intrinsics,
                                  .exposure_s = options_.exposure_ms * 1e-3,
                                  .rolling_shutter_s = options_.rolling_shutter_ms * 1e-3,
                                  .samples_per_pixel = options_.samples,
                                  .threads = options_.threads == 0 ? cores : options_.threads,
                                  .seed = setup_.drive_seed});
  }

  [[nodiscard]] const DrivePlan& plan() const { return plan_; }

 private:
  Drive(const Options& options, const Setup& setup, const World& world, DrivePlan plan)
      : options_(options),
        setup_(setup),
        world_(world),
        plan_(std::move(plan)),
        geometry_{.track_m = setup.vehicle.odometry.drive.track_m,
                  .wheelbase_m = options.geometry.wheelbase_m},
        X_BC_(setup.camera.X_BC()),
        body_(plan_, *world.ground, geometry_, BodyOptions(options, setup)) {}

  static VehicleBodyOptions BodyOptions(const Options& options, const Setup& setup) {
    VehicleBodyOptions body = options.body;
    body.seed = setup.drive_seed;
    return body;
  }

  const Options& options_;
  const Setup& setup_;
  const World& world_;
  DrivePlan plan_;
  VehicleGeometry geometry_;
  Pose3 X_BC_;
  VehicleBody body_;
};

Result<void> AddDepth(FrameRenderer& renderer,
                      std::int64_t time_ns,
                      const FrameRenderer::CameraMotion& camera_at,
                      const DriveWriter& writer) {
  const auto path = writer.MakeDepthPath();
  if (!path) return path.error();
  auto written = WriteDepthFile(*path, renderer.RenderDepth(time_ns, camera_at));
  if (!written) return writer.Incomplete(std::move(written).error());
  return {};
}

/// Renders all images, writes them, and hands them to who plays them.
Result<void> RenderImages(const Drive& drive,
                          const Setup& setup,
                          const Trajectory3& X_WCs,
                          DriveWriter& writer,
                          LiveDrive* live) {
  auto renderer = drive.MakeRenderer();
  if (!renderer) return writer.Incomplete(std::move(renderer).error());
  BoundedJpegEncoder encoder(setup.camera.jpeg_quality, setup.camera.max_jpeg_bytes);
  ProgressLine progress("rendering");
  const auto begin = std::chrono::steady_clock::now();
  const auto camera_at = [&](std::int64_t time_ns) { return drive.CameraAt(time_ns); };
  for (std::size_t i = 0; i < X_WCs.size(); ++i) {
    auto jpeg = encoder.Encode((*renderer)->Render(X_WCs[i].time_ns, camera_at));
    if (!jpeg) return writer.Incomplete(std::move(jpeg).error());
    if (auto ok = writer.AddImage(*jpeg); !ok) return ok;
    if (setup.with_depth) {
      if (auto ok = AddDepth(**renderer, X_WCs[i].time_ns, camera_at, writer); !ok) return ok;
    }
    if (live != nullptr) {
      if (auto ok = live->AddImage(*jpeg); !ok) return writer.Incomplete(std::move(ok).error());
    }
    const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - begin;
    progress.Show(static_cast<double>(i + 1) / static_cast<double>(X_WCs.size()),
                  fmt::format("{} of {} images, {:.1f}/s",
                              i + 1,
                              X_WCs.size(),
                              static_cast<double>(i + 1) / elapsed.count()));
  }
  return {};
}

/// Opens what the options ask for to be live; nothing for nothing.
Result<std::unique_ptr<LiveDevices>> OpenLive(const Options& options, const Setup& setup) {
  if (!options.live.IsAny()) return std::unique_ptr<LiveDevices>();
  return LiveDevices::Open(options.live,
                           {.width = setup.intrinsics.width,
                            .height = setup.intrinsics.height,
                            .frame_rate_hz = options.frame_rate_hz});
}

std::unique_ptr<LiveDrive> MakeLive(const DriveRecord& record, LiveDevices* devices) {
  if (devices == nullptr) return nullptr;
  std::vector<std::int64_t> times_ns;
  for (const TimedPose3& image : record.X_WCs)
    times_ns.push_back(image.time_ns);
  auto live = std::make_unique<LiveDrive>(record.can_frames, std::move(times_ns), *devices);
  if (record.X_WCs.empty()) live->Begin();
  return live;
}

Result<void> FinishLive(LiveDrive& live, const LiveDevices& devices) {
  if (auto ok = live.Finish(); !ok) return ok;
  fmt::print("{}", devices.Summary(live.counters()));
  if (live.counters().late_images + live.counters().dropped_images > 0) {
    fmt::print(stderr,
               "reloc sim: rendering did not keep up; the drive is there now, reloc sim play "
               "plays it on time\n");
  }
  return {};
}

Result<void> SimulateDrive(const Options& options) {
  auto setup = Prepare(options);
  if (!setup) return std::move(setup).error();
  auto devices = OpenLive(options, *setup);
  if (!devices) return std::move(devices).error();
  auto world = MakeWorld(options.world, options.seed);
  if (!world) return std::move(world).error();
  auto drive = Drive::Create(options, *setup, *world);
  if (!drive) return std::move(drive).error();
  auto record = (*drive)->Record();
  if (!record) return std::move(record).error();
  auto writer = DriveWriter::Create(options.out, *record);
  if (!writer) return std::move(writer).error();

  const auto live = MakeLive(*record, devices->get());
  const auto begin = std::chrono::steady_clock::now();
  if (!options.no_images) {
    auto ok = RenderImages(**drive, *setup, record->X_WCs, *writer, live.get());
    if (!ok) return ok;
  }
  const std::chrono::duration<double> rendering = std::chrono::steady_clock::now() - begin;
  if (auto ok = writer->Finish(); !ok) return ok;
  const std::size_t images = record->X_WCs.size();
  fmt::print("{}: {:.1f} m in {:.1f} s; {} CAN frames; {} images, {:.1f}/s\n",
             options.out,
             (*drive)->plan().length_m(),
             static_cast<double>((*drive)->plan().duration_ns()) * 1e-9,
             record->can_frames.size(),
             images,
             images == 0 ? 0.0 : static_cast<double>(images) / rendering.count());
  return live == nullptr ? Result<void>() : FinishLive(*live, **devices);
}

Result<void> ListSessions() {
  for (const SessionTrait& trait : SessionTraits())
    fmt::print("  {:<10} {}\n", trait.name, trait.description);
  fmt::print("\nWords are joined by +, as in evening+wet+traffic.\n");
  return {};
}

Result<void> ListWorlds() {
  for (const std::string& name : WorldNames())
    fmt::print("{}\n", name);
  return {};
}

void AddWorldOptions(CLI::App& app, Options& options) {
  app.add_option("--world", options.world, "see --list-worlds")->capture_default_str();
  app.add_option("--seed", options.seed, "of the world, where it is made from one")
      ->capture_default_str();
  app.add_option("--session", options.session, "the conditions, see --list-sessions")
      ->capture_default_str();
  app.add_option("--drive-seed",
                 options.drive_seed,
                 "of all noise of this drive; without, one that follows from --seed and --session");
  app.add_option("--vehicle", options.vehicle, "its YAML file: cameras, can, odometry");
  app.add_option("--out", options.out, "a new folder for the drive (docs/datasets.md)");
  app.add_flag("--list-sessions", options.list_sessions, "what --session may be made of");
  app.add_flag("--list-worlds", options.list_worlds, "what --world may be");
}

void AddCameraOptions(CLI::App& app, Options& options) {
  app.add_option("--camera", options.camera, "of the vehicle's, by name")->capture_default_str();
  app.add_option("--frame-rate-hz", options.frame_rate_hz, "of the images")->capture_default_str();
  app.add_option("--size", options.size, "of the images, px")->capture_default_str();
  app.add_option("--fov-deg", options.fov_deg, "from the left edge to the right")
      ->capture_default_str();
  app.add_option("--distortion", options.distortion, "k1 k2 p1 p2 k3, as docs/datasets.md has them")
      ->expected(5)
      ->delimiter(',');
  app.add_option("--exposure-ms", options.exposure_ms, "at most: how long images blur")
      ->capture_default_str();
  app.add_option("--rolling-shutter-ms", options.rolling_shutter_ms, "from first to last row")
      ->capture_default_str();
  app.add_option("--samples", options.samples, "rays a pixel")->capture_default_str();
  app.add_option("--threads", options.threads, "for rendering; 0: as many as cores")
      ->capture_default_str();
  app.add_flag("--no-images", options.no_images, "only CAN frames and truth");
  app.add_flag("--depth", options.depth, "depth images too, as an ideal depth camera has them");
}

void AddDrivingOptions(CLI::App& app, DrivePlanOptions& plan) {
  app.add_option("--speed-mps", plan.speed_mps, "where it is straight")->capture_default_str();
  app.add_option("--from-m", plan.begin_m, "where on the route it begins")->capture_default_str();
  app.add_option("--to-m", plan.end_m, "where it ends; without, after a lap, or at the end");
  app.add_option("--laps", plan.laps, "of a route that closes")->capture_default_str();
  app.add_option("--stop-at-m", plan.stops_m, "places on the route to stop at")->delimiter(',');
  app.add_option("--stop-s", plan.stop_s, "for about how long")->capture_default_str();
  app.add_option("--reverse-at-m", plan.reverses_m, "places to stop at and reverse")
      ->delimiter(',');
  app.add_option("--reverse-m", plan.reverse_m, "how far")->capture_default_str();
}

void AddVehicleOptions(CLI::App& app, Options& options) {
  WheelSimulationOptions& wheels = options.wheels;
  app.add_option("--rough", options.body.roughness, "1: the body shakes by 0.4 deg rms")
      ->capture_default_str();
  app.add_option("--wheelbase-m", options.geometry.wheelbase_m)->capture_default_str();
  app.add_option("--track-error", options.track_error, "part by which it is wider than configured")
      ->capture_default_str();
  app.add_option("--radius-sigma", wheels.radius_sigma, "of each wheel's radius, as a part")
      ->capture_default_str();
  app.add_option("--wheel-sigma",
                 wheels.wheel_sigma_m_per_sqrt_m,
                 "of a wheel's travel after a metre, m; negative: as the vehicle's config has it")
      ->capture_default_str();
  app.add_option("--slip",
                 wheels.traction_slip_per_mps2,
                 "part by which wheels turn further for each m/s^2 of acceleration")
      ->capture_default_str();
  app.add_option("--turn-slip",
                 wheels.turn_slip_per_mps2,
                 "the same of the outer wheels in bends, and less of the inner ones")
      ->capture_default_str();
  app.add_option("--slips-per-m", wheels.slips_per_m, "sudden ones of each wheel")
      ->capture_default_str();
  app.add_option("--slip-sigma-m", wheels.slip_sigma_m, "of a sudden one")->capture_default_str();
  app.add_option("--yaw-rate-bias-radps", wheels.yaw_rate_bias_radps)->capture_default_str();
  app.add_option("--yaw-rate-noise-radps", wheels.yaw_rate_noise_radps)->capture_default_str();
  app.add_flag("--no-wheel-errors",
               options.no_wheel_errors,
               "all of these off but the steps of the "
               "signals");
}

}  // namespace

void AddSimDrive(CLI::App& app, const std::string& command_line, SimCommand& command) {
  const auto options = std::make_shared<Options>();  // lives as long as the parser's callback
  options->command_line = command_line;
  AddWorldOptions(app, *options);
  AddCameraOptions(app, *options);
  AddDrivingOptions(app, options->plan);
  AddVehicleOptions(app, *options);
  AddLiveOptions(app, options->live);
  app.callback([options, &app, &command] {
    if (!app.get_subcommands().empty()) return;
    if (options->list_sessions) {
      command = ListSessions;
    } else if (options->list_worlds) {
      command = ListWorlds;
    } else {
      if (options->vehicle.empty()) throw CLI::RequiredError("--vehicle");
      if (options->out.empty()) throw CLI::RequiredError("--out");
      command = [options] { return SimulateDrive(*options); };
    }
  });
}

}  // namespace relocd
