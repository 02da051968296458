#include "simulation/frame_renderer.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "camera/pinhole_camera.h"
#include "rendering/camera_sensor.h"
#include "rendering/image_renderer.h"
#include "rendering/lens.h"
#include "rendering/lighting.h"
#include "rendering/ray_tracer.h"
#include "simulation/actors.h"

namespace relocd {
namespace {

Result<void> CheckOptions(const FrameRendererOptions& options) {
  const auto invalid = [](const char* name, double value, const char* allowed) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("{} is {}, must be {}", name, value, allowed)};
  };
  if (!(options.exposure_s > 0.0 && options.exposure_s <= 0.1))
    return invalid("exposure_s", options.exposure_s, "in (0, 0.1]");
  if (!(options.rolling_shutter_s >= 0.0 && options.rolling_shutter_s <= 0.1))
    return invalid("rolling_shutter_s", options.rolling_shutter_s, "in [0, 0.1]");
  if (options.samples_per_pixel < 1 || options.samples_per_pixel > 64)
    return invalid("samples_per_pixel", options.samples_per_pixel, "in [1, 64]");
  if (options.threads < 1 || options.threads > 256)
    return invalid("threads", options.threads, "in [1, 256]");
  return options.intrinsics.Validate();
}

LightingOptions LightOf(const Session& session) {
  LightingOptions light;
  light.sun_azimuth_rad = session.sun_azimuth_rad;
  light.sun_elevation_rad = session.sun_elevation_rad;
  light.sun_strength = session.sun_strength;
  light.sky_brightness = session.sky_brightness;
  light.lamps_on = session.lamps_on;
  light.haze_per_m = session.haze_per_m;
  light.seed = static_cast<std::uint64_t>(session.sun_azimuth_rad * 1e3 + 1e6);
  return light;
}

AutoExposureOptions ExposureOf(const Session& session, const FrameRendererOptions& options) {
  AutoExposureOptions exposure;
  exposure.max_time_s = options.exposure_s;
  exposure.hunting_stops = session.exposure_hunting;
  return exposure;
}

}  // namespace

struct FrameRenderer::Implementation {
  Implementation(const World& world,
                 const Session& session,
                 const FrameRendererOptions& frame_options)
      : options(frame_options),
        lighting(LightOf(session), world.scene.lamps),
        actors(world, session, frame_options.seed),
        sensor(sensor_options),
        exposure(sensor_options, ExposureOf(session, frame_options)),
        lens(frame_options.intrinsics.width,
             frame_options.intrinsics.height,
             session.lens_dirt,
             session.rain,
             frame_options.seed) {}

  FrameRendererOptions options;
  CameraSensorOptions sensor_options;
  std::unique_ptr<RayTracer> tracer;
  Lighting lighting;
  MovingActors actors;
  std::optional<ImageRenderer> renderer;  ///< Set once the tracer is there.
  CameraSensor sensor;
  AutoExposure exposure;
  Lens lens;
  std::uint64_t frame_count = 0;
};

FrameRenderer::FrameRenderer() = default;
FrameRenderer::~FrameRenderer() = default;

Result<std::unique_ptr<FrameRenderer>> FrameRenderer::Create(const World& world,
                                                             const Session& session,
                                                             const FrameRendererOptions& options) {
  if (auto ok = CheckOptions(options); !ok) return std::move(ok).error().WithContext("camera");
  std::unique_ptr<FrameRenderer> frames(new FrameRenderer());
  frames->implementation_ = std::make_unique<Implementation>(world, session, options);
  Implementation& self = *frames->implementation_;
  auto tracer = RayTracer::Create(world.scene, ParkedCars(world, session));
  if (!tracer) return std::move(tracer).error().WithContext("world " + world.name);
  self.tracer = std::move(tracer).value();
  self.renderer.emplace(PinholeCamera(options.intrinsics),
                        *self.tracer,
                        self.lighting,
                        ImageRendererOptions{.samples_per_pixel = options.samples_per_pixel,
                                             .threads = options.threads,
                                             .wetness = session.wetness});
  return frames;
}

RgbImage FrameRenderer::Render(std::int64_t time_ns, const CameraMotion& camera_motion) {
  Implementation& self = *implementation_;
  // The exposure that the camera is at; the one that this image asks for comes with the next.
  const double exposure_s = self.exposure.last_time_s();
  const double sweep_s = exposure_s + self.options.rolling_shutter_s;
  const auto half_ns = static_cast<std::int64_t>(std::llround(0.5e9 * sweep_s));
  const double time_s = static_cast<double>(time_ns) * 1e-9;
  self.tracer->SetMoving(self.actors.During(time_s - 0.5 * sweep_s, time_s + 0.5 * sweep_s));
  const CameraSweep sweep{.X_WC_begin = camera_motion(time_ns - half_ns),
                          .X_WC_end = camera_motion(time_ns + half_ns),
                          .exposure_part = exposure_s / sweep_s};
  const std::uint64_t seed = self.options.seed * 0x10001 + 2 * self.frame_count++;
  LinearImage radiance = self.renderer->Render(sweep, seed);
  self.lens.Apply(radiance, time_s, seed);
  return self.sensor.Develop(
      radiance, self.exposure.Next(radiance, time_s), seed + 1, self.options.threads);
}

MeasuredDepth FrameRenderer::RenderDepth(std::int64_t time_ns, const CameraMotion& camera_motion) {
  constexpr float kMillimetres = 1000.0F;
  constexpr float kMost_mm = std::numeric_limits<std::uint16_t>::max();
  Implementation& self = *implementation_;
  const double time_s = static_cast<double>(time_ns) * 1e-9;
  self.tracer->SetMoving(self.actors.During(time_s, time_s));
  const DepthImage image = self.renderer->RenderDepth(camera_motion(time_ns));
  MeasuredDepth depth{.width = image.width, .height = image.height, .depth_mm = {}};
  depth.depth_mm.reserve(image.depths_m.size());
  for (const float depth_m : image.depths_m) {
    const float depth_mm = kMillimetres * depth_m;
    const bool is_known = depth_mm > 0.0F && depth_mm < kMost_mm;  // false for what is no number
    depth.depth_mm.push_back(is_known ? static_cast<std::uint16_t>(depth_mm) : std::uint16_t{0});
  }
  return depth;
}

}  // namespace relocd
