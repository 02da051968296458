#include "rendering/ray_tracer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <embree3/rtcore.h>
#include <fmt/format.h>

namespace relocd {
namespace {

/// Rays that Embree traces together.
constexpr std::size_t kPacket = 16;

struct DeviceDeleter {
  void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
};
struct SceneDeleter {
  void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
};
using UniqueDevice = std::unique_ptr<RTCDeviceTy, DeviceDeleter>;
using UniqueScene = std::unique_ptr<RTCSceneTy, SceneDeleter>;

/// A mesh with what its triangles need while rays look for them.
struct TracedMesh {
  const Mesh* mesh = nullptr;
  const Scene* scene = nullptr;
  std::vector<float> uv_per_m;  ///< Of each triangle: texture repetitions per metre.
  bool has_holes = false;       ///< Some texture leaves parts out.
  UniqueScene scene_of_mesh;    ///< For instances; made when needed.
};

/// What takes normals to W, but for their length: the inverse transpose, times the determinant.
Eigen::Matrix3f NormalMatrix(const Eigen::Affine3f& X_WM) {
  const Eigen::Matrix3f linear = X_WM.linear();
  Eigen::Matrix3f cofactors;
  cofactors << linear.col(1).cross(linear.col(2)), linear.col(2).cross(linear.col(0)),
      linear.col(0).cross(linear.col(1));
  return cofactors;
}

/// A mesh where it stands, or between where it is at times 0 and 1.
struct Placement {
  Placement(const TracedMesh& mesh, const Eigen::Affine3f& begin, const Eigen::Affine3f& end)
      : traced(&mesh), normals_begin(NormalMatrix(begin)), normals_end(NormalMatrix(end)) {}

  const TracedMesh* traced;
  Eigen::Matrix3f normals_begin;
  Eigen::Matrix3f normals_end;
};

/// Embree hands this to the filter along with the rays.
struct TracingContext {
  RTCIntersectContext embree{};
  float spread = 0.0F;
};

TracingContext MakeContext(float spread) {
  TracingContext context;
  rtcInitIntersectContext(&context.embree);
  context.spread = spread;
  return context;
}

Eigen::Vector2f Interpolate(const std::vector<Eigen::Vector2f>& values,
                            const std::array<std::uint32_t, 3>& triangle,
                            float u,
                            float v) {
  return (1.0F - u - v) * values[triangle[0]] + u * values[triangle[1]] + v * values[triangle[2]];
}

bool IsCoveredAt(
    const TracedMesh& traced, std::uint32_t triangle, float u, float v, float width_m) {
  const Mesh& mesh = *traced.mesh;
  const Material& material = traced.scene->materials[mesh.triangle_materials[triangle]];
  if (!(material.alpha_cutoff > 0.0F) || material.texture < 0 || mesh.uvs.empty()) return true;
  const Eigen::Vector2f uv = Interpolate(mesh.uvs, mesh.triangles[triangle], u, v);
  const Texture& texture = traced.scene->textures[static_cast<std::size_t>(material.texture)];
  return texture.SampleAlpha(uv.x(), uv.y(), width_m * traced.uv_per_m[triangle]) >=
         material.alpha_cutoff;
}

/// Takes back hits where the texture leaves the surface out. Called by Embree.
void FilterHoles(const RTCFilterFunctionNArguments* arguments) {
  const auto& traced = *static_cast<const TracedMesh*>(arguments->geometryUserPtr);
  // The context was made by MakeContext, whose first member this is.
  const float spread = reinterpret_cast<const TracingContext*>(arguments->context)->spread;
  const unsigned count = arguments->N;
  for (unsigned i = 0; i < count; ++i) {
    if (arguments->valid[i] == 0) continue;
    const float width_m = spread * RTCRayN_tfar(arguments->ray, count, i);
    if (!IsCoveredAt(traced,
                     RTCHitN_primID(arguments->hit, count, i),
                     RTCHitN_u(arguments->hit, count, i),
                     RTCHitN_v(arguments->hit, count, i),
                     width_m)) {
      arguments->valid[i] = 0;
    }
  }
}

std::vector<float> UvPerMetre(const Mesh& mesh) {
  std::vector<float> result(mesh.triangles.size(), 0.0F);
  if (mesh.uvs.empty()) return result;
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    const auto& [a, b, c] = mesh.triangles[i];
    const Eigen::Vector3f ab = mesh.positions[b] - mesh.positions[a];
    const Eigen::Vector3f ac = mesh.positions[c] - mesh.positions[a];
    const Eigen::Vector2f uv_ab = mesh.uvs[b] - mesh.uvs[a];
    const Eigen::Vector2f uv_ac = mesh.uvs[c] - mesh.uvs[a];
    const float area = ab.cross(ac).norm();
    const float uv_area = std::abs(uv_ab.x() * uv_ac.y() - uv_ab.y() * uv_ac.x());
    if (area > 0.0F) result[i] = std::sqrt(uv_area / area);
  }
  return result;
}

bool HasHoles(const Scene& scene, const Mesh& mesh) {
  return std::any_of(
      mesh.triangle_materials.begin(), mesh.triangle_materials.end(), [&](std::uint32_t material) {
        return scene.materials[material].alpha_cutoff > 0.0F;
      });
}

/// Adds the mesh's triangles to a scene of Embree, moved by X_WM.
void AttachTriangles(RTCDevice device,
                     RTCScene scene,
                     const TracedMesh& traced,
                     const Eigen::Affine3f& X_WM) {
  const Mesh& mesh = *traced.mesh;
  RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  auto* const positions = static_cast<float*>(rtcSetNewGeometryBuffer(geometry,
                                                                      RTC_BUFFER_TYPE_VERTEX,
                                                                      0,
                                                                      RTC_FORMAT_FLOAT3,
                                                                      3 * sizeof(float),
                                                                      mesh.positions.size()));
  for (std::size_t i = 0; i < mesh.positions.size(); ++i)
    Eigen::Map<Eigen::Vector3f>(positions + 3 * i) = X_WM * mesh.positions[i];
  auto* const triangles =
      static_cast<std::uint32_t*>(rtcSetNewGeometryBuffer(geometry,
                                                          RTC_BUFFER_TYPE_INDEX,
                                                          0,
                                                          RTC_FORMAT_UINT3,
                                                          3 * sizeof(std::uint32_t),
                                                          mesh.triangles.size()));
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i)
    std::copy(mesh.triangles[i].begin(), mesh.triangles[i].end(), triangles + 3 * i);
  if (traced.has_holes) {
    rtcSetGeometryUserData(geometry, const_cast<TracedMesh*>(&traced));  // NOLINT: C interface
    rtcSetGeometryIntersectFilterFunction(geometry, FilterHoles);
    rtcSetGeometryOccludedFilterFunction(geometry, FilterHoles);
  }
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(scene, geometry);
  rtcReleaseGeometry(geometry);
}

using Matrix34f = Eigen::Matrix<float, 3, 4>;

void AttachInstance(RTCDevice device,
                    RTCScene scene,
                    RTCScene scene_of_mesh,
                    std::span<const Eigen::Affine3f> X_WMs) {
  RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_INSTANCE);
  rtcSetGeometryInstancedScene(geometry, scene_of_mesh);
  rtcSetGeometryTimeStepCount(geometry, static_cast<unsigned>(X_WMs.size()));
  for (unsigned step = 0; step < X_WMs.size(); ++step) {
    const Matrix34f columns = X_WMs[step].matrix().topRows<3>();
    rtcSetGeometryTransform(geometry, step, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, columns.data());
  }
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(scene, geometry);
  rtcReleaseGeometry(geometry);
}

void FillRay(RTCRay16& packet, std::size_t i, const Ray& ray) {
  packet.org_x[i] = ray.origin.x();
  packet.org_y[i] = ray.origin.y();
  packet.org_z[i] = ray.origin.z();
  packet.dir_x[i] = ray.direction.x();
  packet.dir_y[i] = ray.direction.y();
  packet.dir_z[i] = ray.direction.z();
  packet.tnear[i] = ray.near;
  packet.tfar[i] = ray.far;
  packet.time[i] = ray.time;
  packet.mask[i] = 0xFFFFFFFF;
  packet.id[i] = 0;
  packet.flags[i] = 0;
}

using ValidMask = std::array<int, kPacket>;

ValidMask MaskOfFirst(std::size_t count) {
  ValidMask mask{};
  std::fill_n(mask.begin(), count, -1);
  return mask;
}

}  // namespace

struct RayTracer::Implementation {
  const Scene* scene = nullptr;
  UniqueDevice device;
  std::vector<TracedMesh> meshes;  ///< As the scene's; does not grow.
  std::vector<Placement> still;    ///< By Embree's geometry id in `still_scene`.
  std::vector<Placement> moving;   ///< Likewise.
  UniqueScene still_scene;
  UniqueScene moving_scene;  ///< Null while nothing moves.

  void AddMeshes() {
    for (const Mesh& mesh : scene->meshes) {
      meshes.push_back({.mesh = &mesh,
                        .scene = scene,
                        .uv_per_m = UvPerMetre(mesh),
                        .has_holes = HasHoles(*scene, mesh),
                        .scene_of_mesh = nullptr});
    }
  }

  RTCScene SceneOf(TracedMesh& traced) const {
    if (!traced.scene_of_mesh) {
      traced.scene_of_mesh.reset(rtcNewScene(device.get()));
      AttachTriangles(
          device.get(), traced.scene_of_mesh.get(), traced, Eigen::Affine3f::Identity());
      rtcCommitScene(traced.scene_of_mesh.get());
    }
    return traced.scene_of_mesh.get();
  }

  /// Meshes that are there once become part of the whole, which is faster to trace than instances.
  void AddStill(std::span<const MeshInstance> instances, std::span<const MeshInstance> more) {
    std::vector<MeshInstance> all(instances.begin(), instances.end());
    all.insert(all.end(), more.begin(), more.end());
    std::vector<int> uses(meshes.size(), 0);
    for (const MeshInstance& instance : all)
      ++uses[instance.mesh];
    still_scene.reset(rtcNewScene(device.get()));
    for (const MeshInstance& instance : all) {
      TracedMesh& traced = meshes[instance.mesh];
      if (uses[instance.mesh] == 1) {
        AttachTriangles(device.get(), still_scene.get(), traced, instance.X_WM);
      } else {
        AttachInstance(
            device.get(), still_scene.get(), SceneOf(traced), std::span(&instance.X_WM, 1));
      }
      still.emplace_back(traced, instance.X_WM, instance.X_WM);
    }
    rtcCommitScene(still_scene.get());
  }

  [[nodiscard]] const Placement& PlacementOf(const Hit& hit) const {
    return hit.placement < still.size() ? still[hit.placement]
                                        : moving[hit.placement - still.size()];
  }

  void IntersectPacket(std::span<const Ray> rays, float spread, std::span<Hit> hits) const {
    alignas(64) RTCRayHit16 packet{};
    for (std::size_t i = 0; i < rays.size(); ++i) {
      FillRay(packet.ray, i, rays[i]);
      packet.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
      packet.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
      hits[i] = Hit{};
    }
    alignas(64) const ValidMask valid = MaskOfFirst(rays.size());
    TracingContext context = MakeContext(spread);
    // What the caller hands over together are neighbours on the way from the camera. (Embree 3.13
    // must not be told so in OccludedPacket: it may then search without end.)
    context.embree.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    rtcIntersect16(valid.data(), still_scene.get(), &context.embree, &packet);
    TakeHits(packet, 0, hits);
    if (!moving_scene) return;
    for (std::size_t i = 0; i < rays.size(); ++i) {
      packet.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
      packet.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
    }
    rtcIntersect16(valid.data(), moving_scene.get(), &context.embree, &packet);
    TakeHits(packet, static_cast<std::uint32_t>(still.size()), hits);
  }

  static void TakeHits(const RTCRayHit16& packet, std::uint32_t first, std::span<Hit> hits) {
    for (std::size_t i = 0; i < hits.size(); ++i) {
      if (packet.hit.geomID[i] == RTC_INVALID_GEOMETRY_ID) continue;
      const std::uint32_t instance = packet.hit.instID[0][i];
      const bool is_instance = instance != RTC_INVALID_GEOMETRY_ID;
      hits[i] = {.distance = packet.ray.tfar[i],
                 .placement = first + (is_instance ? instance : packet.hit.geomID[i]),
                 .triangle = packet.hit.primID[i],
                 .u = packet.hit.u[i],
                 .v = packet.hit.v[i]};
    }
  }

  void OccludedPacket(std::span<const Ray> rays,
                      float spread,
                      std::span<std::uint8_t> occluded) const {
    alignas(64) RTCRay16 packet{};
    for (std::size_t i = 0; i < rays.size(); ++i)
      FillRay(packet, i, rays[i]);
    alignas(64) const ValidMask valid = MaskOfFirst(rays.size());
    TracingContext context = MakeContext(spread);
    rtcOccluded16(valid.data(), still_scene.get(), &context.embree, &packet);
    if (moving_scene) rtcOccluded16(valid.data(), moving_scene.get(), &context.embree, &packet);
    // Embree marks an occluded ray by this.
    for (std::size_t i = 0; i < rays.size(); ++i)
      occluded[i] = packet.tfar[i] < 0.0F ? 1 : 0;
  }
};

RayTracer::RayTracer() : implementation_(std::make_unique<Implementation>()) {}

RayTracer::~RayTracer() = default;

Result<std::unique_ptr<RayTracer>> RayTracer::Create(const Scene& scene,
                                                     std::span<const MeshInstance> more) {
  if (auto ok = scene.Validate(); !ok) return std::move(ok).error();
  for (const MeshInstance& instance : more) {
    if (instance.mesh >= scene.meshes.size()) {
      return Error{
          ErrorKind::kInvalidInput,
          fmt::format("instance of mesh {}, must be below {}", instance.mesh, scene.meshes.size())};
    }
  }
  std::unique_ptr<RayTracer> tracer(new RayTracer());
  Implementation& self = *tracer->implementation_;
  self.scene = &scene;
  self.device.reset(rtcNewDevice(nullptr));
  if (!self.device) {
    return Error{
        ErrorKind::kInternal,
        fmt::format("start Embree: error {}", static_cast<int>(rtcGetDeviceError(nullptr)))};
  }
  self.AddMeshes();
  self.AddStill(scene.instances, more);
  if (const RTCError error = rtcGetDeviceError(self.device.get()); error != RTC_ERROR_NONE) {
    return Error{ErrorKind::kInternal,
                 fmt::format("hand the scene to Embree: error {}", static_cast<int>(error))};
  }
  return tracer;
}

void RayTracer::SetMoving(std::span<const MovingMesh> moving) {
  Implementation& self = *implementation_;
  self.moving.clear();
  self.moving_scene.reset();
  if (moving.empty()) return;
  self.moving_scene.reset(rtcNewScene(self.device.get()));
  for (const MovingMesh& mover : moving) {
    TracedMesh& traced = self.meshes[mover.mesh];
    const std::array<Eigen::Affine3f, 2> X_WMs{mover.X_WM_begin, mover.X_WM_end};
    AttachInstance(self.device.get(), self.moving_scene.get(), self.SceneOf(traced), X_WMs);
    self.moving.emplace_back(traced, mover.X_WM_begin, mover.X_WM_end);
  }
  rtcCommitScene(self.moving_scene.get());
}

void RayTracer::Intersect(std::span<const Ray> rays, float spread, std::span<Hit> hits) const {
  for (std::size_t begin = 0; begin < rays.size(); begin += kPacket) {
    const std::size_t count = std::min(kPacket, rays.size() - begin);
    implementation_->IntersectPacket(
        rays.subspan(begin, count), spread, hits.subspan(begin, count));
  }
}

void RayTracer::Occluded(std::span<const Ray> rays,
                         float spread,
                         std::span<std::uint8_t> occluded) const {
  for (std::size_t begin = 0; begin < rays.size(); begin += kPacket) {
    const std::size_t count = std::min(kPacket, rays.size() - begin);
    implementation_->OccludedPacket(
        rays.subspan(begin, count), spread, occluded.subspan(begin, count));
  }
}

Surface RayTracer::SurfaceAt(const Ray& ray, const Hit& hit, float spread) const {
  const Placement& placement = implementation_->PlacementOf(hit);
  const TracedMesh& traced = *placement.traced;
  const Mesh& mesh = *traced.mesh;
  const auto& triangle = mesh.triangles[hit.triangle];
  const Eigen::Matrix3f normals =
      placement.normals_begin + ray.time * (placement.normals_end - placement.normals_begin);
  const auto to_world = [&](const Eigen::Vector3f& normal_M) -> Eigen::Vector3f {
    const Eigen::Vector3f normal_W = (normals * normal_M).normalized();
    return normal_W.dot(ray.direction) > 0.0F ? Eigen::Vector3f(-normal_W) : normal_W;
  };
  const Eigen::Vector3f edges_normal =
      (mesh.positions[triangle[1]] - mesh.positions[triangle[0]])
          .cross(mesh.positions[triangle[2]] - mesh.positions[triangle[0]]);
  Surface surface;
  surface.position = ray.origin + hit.distance * ray.direction;
  surface.geometric_normal = to_world(edges_normal);
  surface.normal = surface.geometric_normal;
  if (!mesh.normals.empty()) {
    surface.normal =
        to_world((1.0F - hit.u - hit.v) * mesh.normals[triangle[0]] +
                 hit.u * mesh.normals[triangle[1]] + hit.v * mesh.normals[triangle[2]]);
  }
  surface.material = &traced.scene->materials[mesh.triangle_materials[hit.triangle]];
  surface.albedo = surface.material->albedo;
  if (surface.material->texture >= 0 && !mesh.uvs.empty()) {
    const Eigen::Vector2f uv = Interpolate(mesh.uvs, triangle, hit.u, hit.v);
    // Seen at a low angle, what a ray stands for is long and narrow; its geometric mean is taken.
    constexpr float kLeastCosine = 0.05F;
    const float cosine = std::max(kLeastCosine, -surface.geometric_normal.dot(ray.direction));
    const float width_m = spread * hit.distance / std::sqrt(cosine);
    const Texture& texture =
        traced.scene->textures[static_cast<std::size_t>(surface.material->texture)];
    surface.albedo *=
        texture.Sample(uv.x(), uv.y(), width_m * traced.uv_per_m[hit.triangle]).head<3>();
  }
  return surface;
}

}  // namespace relocd
