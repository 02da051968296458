#include "rendering/scene.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

namespace relocd {
namespace {

Error Invalid(const char* thing, std::size_t index, std::string problem) {
  return {ErrorKind::kInvalidInput, fmt::format("{} {}: {}", thing, index, problem)};
}

template <typename Vectors>
bool AllFinite(const Vectors& vectors) {
  return std::all_of(
      vectors.begin(), vectors.end(), [](const auto& vector) { return vector.allFinite(); });
}

Result<void> CheckMesh(const Mesh& mesh, std::size_t index, std::size_t materials) {
  const std::size_t vertices = mesh.positions.size();
  if (!mesh.normals.empty() && mesh.normals.size() != vertices)
    return Invalid(
        "mesh", index, fmt::format("{} normals for {} positions", mesh.normals.size(), vertices));
  if (!mesh.uvs.empty() && mesh.uvs.size() != vertices)
    return Invalid(
        "mesh",
        index,
        fmt::format("{} texture coordinates for {} positions", mesh.uvs.size(), vertices));
  if (mesh.triangle_materials.size() != mesh.triangles.size())
    return Invalid("mesh",
                   index,
                   fmt::format("{} materials for {} triangles",
                               mesh.triangle_materials.size(),
                               mesh.triangles.size()));
  if (!AllFinite(mesh.positions) || !AllFinite(mesh.normals) || !AllFinite(mesh.uvs))
    return Invalid("mesh", index, "a number is not finite");
  for (const auto& triangle : mesh.triangles) {
    for (const std::uint32_t vertex : triangle) {
      if (vertex >= vertices)
        return Invalid("mesh",
                       index,
                       fmt::format("a triangle has vertex {}, must be below {}", vertex, vertices));
    }
  }
  for (const std::uint32_t material : mesh.triangle_materials) {
    if (material >= materials)
      return Invalid(
          "mesh",
          index,
          fmt::format("a triangle has material {}, must be below {}", material, materials));
  }
  return {};
}

}  // namespace

std::uint32_t Scene::AddTexture(Texture texture) {
  textures.push_back(std::move(texture));
  return static_cast<std::uint32_t>(textures.size() - 1);
}

std::uint32_t Scene::AddMaterial(Material material) {
  materials.push_back(std::move(material));
  return static_cast<std::uint32_t>(materials.size() - 1);
}

std::uint32_t Scene::AddMesh(Mesh mesh) {
  meshes.push_back(std::move(mesh));
  return static_cast<std::uint32_t>(meshes.size() - 1);
}

Result<void> Scene::Validate() const {
  for (std::size_t i = 0; i < materials.size(); ++i) {
    const int texture = materials[i].texture;
    if (texture < -1 || texture >= static_cast<int>(textures.size()))
      return Invalid(
          "material", i, fmt::format("texture {}, must be in [-1, {})", texture, textures.size()));
  }
  for (std::size_t i = 0; i < meshes.size(); ++i) {
    if (auto ok = CheckMesh(meshes[i], i, materials.size()); !ok) return ok;
  }
  for (std::size_t i = 0; i < instances.size(); ++i) {
    if (instances[i].mesh >= meshes.size())
      return Invalid("instance",
                     i,
                     fmt::format("mesh {}, must be below {}", instances[i].mesh, meshes.size()));
    if (!instances[i].X_WM.matrix().allFinite())
      return Invalid("instance", i, "its place is not finite");
  }
  return {};
}

std::size_t Scene::CountTriangles() const {
  std::size_t count = 0;
  for (const MeshInstance& instance : instances)
    count += meshes[instance.mesh].triangles.size();
  return count;
}

}  // namespace relocd
