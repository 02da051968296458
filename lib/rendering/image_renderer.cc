#include "rendering/image_renderer.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <span>
#include <thread>

#ifdef __SSE2__
#include <pmmintrin.h>
#include <xmmintrin.h>
#endif

#include "core/check.h"
#include "core/counter_random.h"

namespace relocd {
namespace {

constexpr int kTile = 16;
/// Textures are filtered over this part of a pixel: the several samples of one smooth as well.
constexpr float kSharpness = 0.6F;
/// Within this distance something is near enough to keep the sky's light away.
constexpr float kOcclusionReachM = 4.0F;
/// Of a square as large as the sun's disk, whose radius is 0.0047 as seen from the ground.
constexpr float kSunSide = 0.0083F;
/// Rays leave surfaces from this far above them, and more at large distances, where floats are
/// coarse.
constexpr float kLiftM = 2e-3F;

/// Some direction across another one.
Eigen::Vector3f DirectionAcross(const Eigen::Vector3f& axis) {
  constexpr float kNearlyUp = 0.9F;
  if (std::abs(axis.z()) < kNearlyUp) return axis.cross(Eigen::Vector3f::UnitZ()).normalized();
  return axis.cross(Eigen::Vector3f::UnitX()).normalized();
}

/// Two unit vectors that with `axis` make a right-handed frame.
struct Tangents {
  explicit Tangents(const Eigen::Vector3f& axis)
      : first(DirectionAcross(axis)), second(axis.cross(first)) {}
  Eigen::Vector3f first;
  Eigen::Vector3f second;
};

Eigen::Vector2f UniformDisk(float a, float b) {
  const float radius = std::sqrt(a);
  const float angle = 2.0F * std::numbers::pi_v<float> * b;
  return {radius * std::cos(angle), radius * std::sin(angle)};
}

/// Directions about the z axis, as often near it as the light of an even sky counts: Hammersley's
/// points, in an order that scatters neighbours.
std::array<Eigen::Vector3f, 16> MakeSkyDirections() {
  std::array<Eigen::Vector3f, 16> directions;
  for (std::uint32_t i = 0; i < directions.size(); ++i) {
    const std::uint32_t reversed =
        (i & 1U) << 3U | (i & 2U) << 1U | (i & 4U) >> 1U | (i & 8U) >> 3U;
    const Eigen::Vector2f disk = UniformDisk((static_cast<float>(i) + 0.5F) / 16.0F,
                                             (static_cast<float>(reversed) + 0.5F) / 16.0F);
    directions.at(i * 7 % 16) = {
        disk.x(), disk.y(), std::sqrt(std::max(0.0F, 1.0F - disk.squaredNorm()))};
  }
  return directions;
}

const std::array<Eigen::Vector3f, 16> kSkyDirections = MakeSkyDirections();

float SchlickFresnel(float reflectivity, float cosine) {
  const float grazing = 1.0F - std::clamp(cosine, 0.0F, 1.0F);
  const float squared = grazing * grazing;
  return reflectivity + (1.0F - reflectivity) * squared * squared * grazing;
}

/// Embree works several times slower on denormal numbers.
void FlushDenormals() {
#ifdef __SSE2__
  _MM_SET_FLUSH_ZERO_MODE(_MM_FLUSH_ZERO_ON);
  _MM_SET_DENORMALS_ZERO_MODE(_MM_DENORMALS_ZERO_ON);
#endif
}

}  // namespace

ImageRenderer::ImageRenderer(const PinholeCamera& camera,
                             const RayTracer& tracer,
                             const Lighting& lighting,
                             const ImageRendererOptions& options)
    : width_(camera.intrinsics().width),
      height_(camera.intrinsics().height),
      grid_side_(static_cast<int>(std::sqrt(options.samples_per_pixel))),
      pixel_spread_(static_cast<float>(1.0 / camera.intrinsics().fx)),
      cell_size_(1.0F / static_cast<float>(std::max(grid_side_, 1))),
      spread_(pixel_spread_ * cell_size_),
      tracer_(tracer),
      lighting_(lighting),
      options_(options) {
  const Tangents tangents(lighting.to_sun());
  sun_tangent_ = tangents.first;
  sun_bitangent_ = tangents.second;
  RELOCD_CHECK(options.samples_per_pixel >= 1 && options.threads >= 1, "options of a renderer");
  corner_rays_.reserve(static_cast<std::size_t>(width_ + 1) *
                       static_cast<std::size_t>(height_ + 1));
  for (int row = 0; row <= height_; ++row) {
    for (int column = 0; column <= width_; ++column) {
      const auto ray = camera.Unproject({column - 0.5, row - 0.5});
      corner_rays_.push_back(
          ray ? Eigen::Vector2f(ray->cast<float>())
              : Eigen::Vector2f::Constant(std::numeric_limits<float>::quiet_NaN()));
    }
  }
}

/// Renders one tile after another; each thread has one.
///
/// Every sample finds what it sees, and whether the sun shines there; samples of one pixel that see
/// the same triangle are shaded together.
class ImageRenderer::TileRenderer {
 public:
  TileRenderer(const ImageRenderer& renderer, const CameraSweep& sweep, std::uint64_t seed)
      : renderer_(renderer),
        random_(seed),
        begin_(sweep.X_WC_begin.translation().cast<float>()),
        end_(sweep.X_WC_end.translation().cast<float>()),
        rotation_begin_(sweep.X_WC_begin.R().cast<float>()),
        rotation_end_(sweep.X_WC_end.R().cast<float>()),
        exposure_part_(static_cast<float>(sweep.exposure_part)) {}

  void Render(int tile_u, int tile_v, LinearImage& image) {
    CastCameraRays(tile_u, tile_v);
    hits_.resize(samples_.size());
    renderer_.tracer_.Intersect(rays_, renderer_.spread_, hits_);
    FormGroups();
    if (renderer_.lighting_.has_sun()) FindSun();
    FindOpenSky();
    const float weight = 1.0F / static_cast<float>(renderer_.options_.samples_per_pixel);
    for (const Group& group : groups_) {
      image.pixels[samples_[group.begin].pixel] +=
          weight * static_cast<float>(group.count) * Shade(group);
    }
  }

 private:
  /// What a sample draws random numbers for.
  enum Draw : std::uint64_t { kPlace, kSun, kMirror, kDraws };

  /// Four numbers in [0, 1), independent of each other and of those of other draws.
  [[nodiscard]] Eigen::Array4f Random(std::uint64_t sample_id, Draw draw) const {
    const std::uint64_t bits = random_.Bits(sample_id * kDraws + draw);
    constexpr float kUlp = 1.0F / 65536.0F;
    const auto part = [bits](unsigned shift) {
      return static_cast<float>(bits >> shift & 0xFFFFU) * kUlp;
    };
    return {part(0), part(16), part(32), part(48)};
  }

  struct Sample {
    std::size_t pixel = 0;
    std::uint64_t id = 0;  ///< Unique in the image.
  };

  /// Samples of a pixel that see the same triangle: rays_, hits_ and samples_ from `begin` on.
  struct Group {
    std::size_t begin = 0;
    std::size_t count = 0;
    Surface surface{};       ///< Where the first of them hits; nothing if they see the sky.
    float sun = 0.0F;        ///< Part of the sun's light that falls on it.
    float open = 1.0F;       ///< Part of the sky's light.
    bool looked_up = false;  ///< Whether `open` was looked for, and may be shared.
  };

  void CastCameraRays(int tile_u, int tile_v) {
    rays_.clear();
    samples_.clear();
    tile_u_ = tile_u;
    tile_v_ = tile_v;
    tile_u_end_ = std::min(tile_u + kTile, renderer_.width_);
    tile_v_end_ = std::min(tile_v + kTile, renderer_.height_);
    for (int v = tile_v; v < tile_v_end_; ++v) {
      for (int u = tile_u; u < tile_u_end_; ++u) {
        CastCameraRays(PixelRays(*this, u, v));
      }
    }
  }

  /// The rays of a pixel in W, to first order in the place within the pixel and in time.
  struct PixelRays {
    PixelRays(const TileRenderer& tile, int column, int row) : u(column), v(row) {
      const ImageRenderer& renderer = tile.renderer_;
      const Eigen::Vector2f& corner = renderer.CornerRay(u, v);
      const Eigen::Vector3f p_C(corner.x(), corner.y(), 1.0F);
      begin = tile.rotation_begin_ * p_C;
      turn = tile.rotation_end_ * p_C - begin;
      along_u = tile.rotation_begin_.leftCols<2>() * (renderer.CornerRay(u + 1, v) - corner);
      along_v = tile.rotation_begin_.leftCols<2>() * (renderer.CornerRay(u, v + 1) - corner);
    }

    int u;
    int v;
    Eigen::Vector3f begin;    ///< Through the pixel's first corner, at the sweep's begin.
    Eigen::Vector3f turn;     ///< How it changes until the sweep's end,
    Eigen::Vector3f along_u;  ///< and across the pixel.
    Eigen::Vector3f along_v;
  };

  /// Samples of a pixel lie in the cells of a square grid, and at different times.
  void CastCameraRays(const PixelRays& pixel_rays) {
    // Where the lens leads no light, the image stays black.
    if (!(pixel_rays.begin + pixel_rays.along_u + pixel_rays.along_v).allFinite()) return;
    const int samples = renderer_.options_.samples_per_pixel;
    const int side = renderer_.grid_side_;
    const std::size_t pixel =
        static_cast<std::size_t>(pixel_rays.v) * static_cast<std::size_t>(renderer_.width_) +
        static_cast<std::size_t>(pixel_rays.u);
    const float row_part =
        static_cast<float>(pixel_rays.v) / static_cast<float>(std::max(renderer_.height_ - 1, 1));
    for (int s = 0; s < samples; ++s) {
      const std::uint64_t id =
          pixel * static_cast<std::uint64_t>(samples) + static_cast<std::uint64_t>(s);
      const Eigen::Array4f random = Random(id, kPlace);
      Eigen::Array2f offset = random.head<2>();
      if (s < side * side) {
        const int row = s / side;
        const Eigen::Array2f cell(static_cast<float>(s - row * side), static_cast<float>(row));
        offset = (offset + cell) * renderer_.cell_size_;
      }
      const float in_exposure = (static_cast<float>(s) + random[2]) / static_cast<float>(samples);
      Ray ray;
      ray.time = (1.0F - exposure_part_) * row_part + exposure_part_ * in_exposure;
      ray.origin = begin_ + ray.time * (end_ - begin_);
      ray.direction = (pixel_rays.begin + ray.time * pixel_rays.turn +
                       offset.x() * pixel_rays.along_u + offset.y() * pixel_rays.along_v)
                          .normalized();
      rays_.push_back(ray);
      samples_.push_back({.pixel = pixel, .id = id});
    }
  }

  [[nodiscard]] bool SeeTheSame(std::size_t a, std::size_t b) const {
    return hits_[a].placement == hits_[b].placement &&
           (!hits_[a].is_hit() || hits_[a].triangle == hits_[b].triangle);
  }

  void FormGroups() {
    groups_.clear();
    first_group_.fill(kNoGroup);
    for (std::size_t begin = 0; begin < samples_.size();) {
      std::size_t end = begin;
      while (end < samples_.size() && samples_[end].pixel == samples_[begin].pixel)
        ++end;
      while (begin < end) {
        const std::size_t next = GatherWhatSeesTheSame(begin, end);
        AddGroup(begin, next - begin);
        begin = next;
      }
    }
  }

  /// Brings the samples that see what the first one sees to the front. @return where they end.
  std::size_t GatherWhatSeesTheSame(std::size_t begin, std::size_t end) {
    std::size_t next = begin + 1;
    for (std::size_t i = next; i < end; ++i) {
      if (!SeeTheSame(begin, i)) continue;
      std::swap(rays_[i], rays_[next]);
      std::swap(hits_[i], hits_[next]);
      std::swap(samples_[i], samples_[next]);
      ++next;
    }
    return next;
  }

  void AddGroup(std::size_t begin, std::size_t count) {
    Group group{.begin = begin, .count = count};
    if (hits_[begin].is_hit()) {
      group.surface = renderer_.tracer_.SurfaceAt(
          rays_[begin], hits_[begin], kSharpness * renderer_.pixel_spread_);
    }
    groups_.push_back(group);
    const auto [u, v] = PixelOf(group);
    std::uint32_t& first = first_group_.at(TileIndex(u, v));
    if (first == kNoGroup) first = static_cast<std::uint32_t>(groups_.size() - 1);
  }

  /// A point above the surface, from which rays do not meet the surface itself.
  [[nodiscard]] Eigen::Vector3f Above(const Group& group, std::size_t sample) const {
    const float distance = hits_[sample].distance;
    return rays_[sample].origin + distance * rays_[sample].direction +
           (kLiftM + 2e-5F * distance) * group.surface.geometric_normal;
  }

  /// Two samples of a group look for the sun; only where they disagree do the others.
  void FindSun() {
    sun_visible_.assign(samples_.size(), 1);
    ClearSecondary();
    for (Group& group : groups_) {
      group.sun = SunOn(group);
      if (!(group.sun > 0.0F)) continue;
      CastSunRay(group, group.begin);
      if (group.count > 1) CastSunRay(group, group.begin + group.count - 1);
    }
    TraceSun();
    ClearSecondary();
    for (const Group& group : groups_) {
      if (group.sun > 0.0F && group.count > 2) CastSunRaysBetween(group);
    }
    TraceSun();
    for (Group& group : groups_)
      group.sun *= VisiblePartOfSun(group);
  }

  void CastSunRaysBetween(const Group& group) {
    const std::size_t last = group.begin + group.count - 1;
    const bool agree = sun_visible_[group.begin] == sun_visible_[last];
    for (std::size_t i = group.begin + 1; i < last; ++i) {
      sun_visible_[i] = sun_visible_[last];
      if (!agree) CastSunRay(group, i);
    }
  }

  [[nodiscard]] float VisiblePartOfSun(const Group& group) const {
    int visible = 0;
    for (std::size_t i = group.begin; i < group.begin + group.count; ++i)
      visible += sun_visible_[i];
    return static_cast<float>(visible) / static_cast<float>(group.count);
  }

  /// The part of the sun's light that would fall on the surface without shadows.
  [[nodiscard]] float SunOn(const Group& group) const {
    if (!hits_[group.begin].is_hit()) return 0.0F;
    const Eigen::Vector3f& to_sun = renderer_.lighting_.to_sun();
    const float cosine = group.surface.normal.dot(to_sun);
    if (!IsLitFromBehind(group)) return std::max(cosine, 0.0F);
    return group.surface.material->translucency * std::abs(cosine);
  }

  [[nodiscard]] bool IsLitFromBehind(const Group& group) const {
    return group.surface.geometric_normal.dot(renderer_.lighting_.to_sun()) < 0.0F;
  }

  void CastSunRay(const Group& group, std::size_t sample) {
    const Lighting& lighting = renderer_.lighting_;
    const Eigen::Array4f random = Random(samples_[sample].id, kSun);
    // A square as large as the disk is as good for soft edges of shadows.
    const Eigen::Array2f disk = kSunSide * (random.head<2>() - 0.5F);
    Ray ray;
    ray.origin = Above(group, sample);
    if (IsLitFromBehind(group)) {
      const Eigen::Vector3f position =
          rays_[sample].origin + hits_[sample].distance * rays_[sample].direction;
      ray.origin = 2.0F * position - ray.origin;
    }
    ray.direction = (lighting.to_sun() + disk.x() * renderer_.sun_tangent_ +
                     disk.y() * renderer_.sun_bitangent_)
                        .normalized();
    ray.time = rays_[sample].time;
    secondary_.push_back(ray);
    owners_.push_back(sample);
  }

  void TraceSun() {
    TraceOccluded();
    for (std::size_t k = 0; k < owners_.size(); ++k)
      sun_visible_[owners_[k]] = occluded_[k] != 0 ? 0 : 1;
  }

  /// One sample of each group of every other pixel looks for what is right above it, in one of 16
  /// directions: the next pixels look in others, and what they find is shared.
  void FindOpenSky() {
    ClearSecondary();
    for (std::size_t g = 0; g < groups_.size(); ++g) {
      Group& group = groups_[g];
      if (!hits_[group.begin].is_hit()) continue;
      if (group.surface.material->translucency > 0.0F) {
        constexpr float kAmongLeaves = 0.75F;
        group.open = kAmongLeaves;
        continue;
      }
      const auto [u, v] = PixelOf(group);
      if ((u + v) % 2 != 0) continue;
      const Eigen::Vector3f& p_NQ =
          kSkyDirections.at(static_cast<std::size_t>(4 * (v % 4) + u % 4));
      const Tangents tangents(group.surface.geometric_normal);
      Ray ray;
      ray.origin = Above(group, group.begin);
      ray.direction = p_NQ.x() * tangents.first + p_NQ.y() * tangents.second +
                      p_NQ.z() * group.surface.geometric_normal;
      ray.far = kOcclusionReachM;
      ray.time = rays_[group.begin].time;
      group.looked_up = true;
      secondary_.push_back(ray);
      owners_.push_back(g);
    }
    TraceOccluded();
    for (std::size_t k = 0; k < owners_.size(); ++k) {
      // What keeps the sky away shines a little itself.
      constexpr float kOfOccluder = 0.2F;
      if (occluded_[k] != 0) groups_[owners_[k]].open = kOfOccluder;
    }
    ShareOpenSky();
  }

  /// Replaces what each group sees of the sky by the mean of 4 x 4 pixels that see the same
  /// surface.
  void ShareOpenSky() {
    shared_open_.resize(groups_.size());
    for (std::size_t g = 0; g < groups_.size(); ++g) {
      const Group& group = groups_[g];
      const bool shares =
          hits_[group.begin].is_hit() && group.surface.material->translucency <= 0.0F;
      shared_open_[g] = shares ? MeanOpenSky(g) : group.open;
    }
    for (std::size_t g = 0; g < groups_.size(); ++g)
      groups_[g].open = shared_open_[g];
  }

  [[nodiscard]] float MeanOpenSky(std::size_t g) const {
    const Group& group = groups_[g];
    const auto [u, v] = PixelOf(group);
    // The window stays within the tile, and so has each direction once.
    const int u_begin = std::clamp(u - 2, tile_u_, std::max(tile_u_, tile_u_end_ - 4));
    const int v_begin = std::clamp(v - 2, tile_v_, std::max(tile_v_, tile_v_end_ - 4));
    float sum = group.looked_up ? group.open : 0.0F;
    float count = group.looked_up ? 1.0F : 0.0F;
    for (int row = v_begin; row < std::min(v_begin + 4, tile_v_end_); ++row) {
      for (int column = u_begin; column < std::min(u_begin + 4, tile_u_end_); ++column) {
        const std::uint32_t other = first_group_[TileIndex(column, row)];
        if (other == kNoGroup || other == g || !MayShare(group, groups_[other])) continue;
        sum += groups_[other].open;
        count += 1.0F;
      }
    }
    return count > 0.0F ? sum / count : group.open;
  }

  [[nodiscard]] bool MayShare(const Group& group, const Group& other) const {
    return other.looked_up && AreOneSurface(group, other);
  }

  [[nodiscard]] bool AreOneSurface(const Group& a, const Group& b) const {
    if (!hits_[b.begin].is_hit()) return false;
    constexpr float kLeastCosine = 0.9F;
    constexpr float kMaxStepM = 0.05F;
    const Eigen::Vector3f& normal = a.surface.geometric_normal;
    return normal.dot(b.surface.geometric_normal) > kLeastCosine &&
           std::abs(normal.dot(b.surface.position - a.surface.position)) <
               kMaxStepM + 0.005F * hits_[a.begin].distance;
  }

  [[nodiscard]] std::array<int, 2> PixelOf(const Group& group) const {
    const auto width = static_cast<std::size_t>(renderer_.width_);
    const std::size_t pixel = samples_[group.begin].pixel;
    return {static_cast<int>(pixel % width), static_cast<int>(pixel / width)};
  }

  [[nodiscard]] std::size_t TileIndex(int u, int v) const {
    return static_cast<std::size_t>(v - tile_v_) * std::size_t{kTile} +
           static_cast<std::size_t>(u - tile_u_);
  }

  void ClearSecondary() {
    secondary_.clear();
    owners_.clear();
  }

  void TraceOccluded() {
    occluded_.resize(secondary_.size());
    renderer_.tracer_.Occluded(secondary_, renderer_.pixel_spread_, occluded_);
  }

  [[nodiscard]] Eigen::Array3f Shade(const Group& group) const {
    const Lighting& lighting = renderer_.lighting_;
    const Ray& ray = rays_[group.begin];
    if (!hits_[group.begin].is_hit()) return lighting.SkyRadiance(ray.direction);
    const Surface& surface = group.surface;
    const Material& material = *surface.material;
    const auto wetness = static_cast<float>(renderer_.options_.wetness) *
                         std::max(surface.geometric_normal.z(), 0.0F);
    Eigen::Array3f light = group.open * lighting.AmbientIrradiance(surface.normal);
    if (lighting.has_sun()) light += group.sun * lighting.sun_irradiance();
    if (lighting.lamps_on()) light += lighting.LampIrradiance(surface.position, surface.normal);
    Eigen::Array3f radiance = surface.albedo * (1.0F - wetness * material.wet_darkening) * light;
    if (lighting.lamps_on()) radiance += material.emission;
    const float reflectivity =
        material.reflectivity + wetness * (material.wet_reflectivity - material.reflectivity);
    if (reflectivity > 0.0F) {
      const float part = SchlickFresnel(reflectivity, -surface.normal.dot(ray.direction));
      radiance = (1.0F - part) * radiance + part * Mirrored(group, wetness > 0.0F);
    }
    return lighting.ThroughHaze(radiance, hits_[group.begin].distance);
  }

  /// What a mirror in the place of the surface shows, without shadows and mirrors in it.
  [[nodiscard]] Eigen::Array3f Mirrored(const Group& group, bool is_rough) const {
    const Lighting& lighting = renderer_.lighting_;
    const Surface& surface = group.surface;
    const Eigen::Vector3f& incoming = rays_[group.begin].direction;
    Ray ray;
    ray.origin = Above(group, group.begin);
    ray.direction = incoming - 2.0F * incoming.dot(surface.normal) * surface.normal;
    if (is_rough) {
      constexpr float kRoughness = 0.05F;
      const Eigen::Array4f random = Random(samples_[group.begin].id, kMirror) - 0.5F;
      ray.direction += kRoughness * random.head<3>().matrix();
    }
    ray.direction.normalize();
    ray.time = rays_[group.begin].time;
    constexpr float kSpread = 0.02F;  // Reflections need no fine detail.
    Hit hit;
    renderer_.tracer_.Intersect(std::span(&ray, 1), kSpread, std::span(&hit, 1));
    if (!hit.is_hit()) return lighting.SkyRadiance(ray.direction);
    const Surface seen = renderer_.tracer_.SurfaceAt(ray, hit, kSpread);
    Eigen::Array3f light = lighting.AmbientIrradiance(seen.normal);
    if (lighting.has_sun()) {
      constexpr float kHalfShadowed = 0.5F;
      light += kHalfShadowed * std::max(seen.normal.dot(lighting.to_sun()), 0.0F) *
               lighting.sun_irradiance();
    }
    Eigen::Array3f radiance = seen.albedo * light;
    if (lighting.lamps_on()) {
      radiance += seen.albedo * lighting.LampIrradiance(seen.position, seen.normal) +
                  seen.material->emission;
    }
    return lighting.ThroughHaze(radiance, hit.distance);
  }

  const ImageRenderer& renderer_;
  CounterRandom random_;
  Eigen::Vector3f begin_;
  Eigen::Vector3f end_;
  Eigen::Matrix3f rotation_begin_;
  Eigen::Matrix3f rotation_end_;
  float exposure_part_;

  // By sample of the tile, those of a pixel next to each other; kept between tiles so that nothing
  // is allocated.
  std::vector<Ray> rays_;
  std::vector<Sample> samples_;
  std::vector<Hit> hits_;
  std::vector<std::uint8_t> sun_visible_;

  std::vector<Group> groups_;
  std::vector<float> shared_open_;  ///< By group.

  static constexpr std::uint32_t kNoGroup = 0xFFFFFFFF;
  int tile_u_ = 0;
  int tile_v_ = 0;
  int tile_u_end_ = 0;
  int tile_v_end_ = 0;
  std::array<std::uint32_t, std::size_t{kTile} * kTile>
      first_group_{};  ///< Of each pixel of the tile.

  // By ray from a surface, and the sample or group whose surface that is.
  std::vector<Ray> secondary_;
  std::vector<std::size_t> owners_;
  std::vector<std::uint8_t> occluded_;
};

LinearImage ImageRenderer::Render(const CameraSweep& sweep, std::uint64_t seed) const {
  LinearImage image = LinearImage::Black(width_, height_);
  const int columns = (width_ + kTile - 1) / kTile;
  const int rows = (height_ + kTile - 1) / kTile;
  std::atomic<int> next_tile = 0;
  const auto work = [&] {
    FlushDenormals();
    TileRenderer renderer(*this, sweep, seed);
    for (int tile = next_tile++; tile < columns * rows; tile = next_tile++)
      renderer.Render(tile % columns * kTile, tile / columns * kTile, image);
  };
  std::vector<std::jthread> threads;
  threads.reserve(static_cast<std::size_t>(options_.threads));
  for (int i = 0; i < options_.threads; ++i)
    threads.emplace_back(work);
  threads.clear();
  return image;
}

DepthImage ImageRenderer::RenderDepth(const Pose3& X_WC) const {
  DepthImage image{.width = width_, .height = height_, .depths_m = {}};
  const std::size_t pixels = static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_);
  std::vector<Ray> rays;
  std::vector<float> cosines;
  rays.reserve(pixels);
  cosines.reserve(pixels);
  image.depths_m.reserve(pixels);
  for (int v = 0; v < height_; ++v) {
    for (int u = 0; u < width_; ++u) {
      const Eigen::Vector2f through = 0.25F * (CornerRay(u, v) + CornerRay(u + 1, v) +
                                               CornerRay(u, v + 1) + CornerRay(u + 1, v + 1));
      const Eigen::Vector3f p_C(through.x(), through.y(), 1.0F);
      Ray ray;
      ray.origin = X_WC.translation().cast<float>();
      ray.direction = (X_WC.rotation().cast<float>() * p_C).normalized();
      if (!p_C.allFinite()) ray.far = 0.0F;
      rays.push_back(ray);
      cosines.push_back(1.0F / p_C.norm());
    }
  }
  std::vector<Hit> hits(rays.size());
  tracer_.Intersect(rays, spread_, hits);
  for (std::size_t i = 0; i < hits.size(); ++i)
    image.depths_m.push_back(hits[i].distance * cosines[i]);
  return image;
}

}  // namespace relocd
