#include "simulation/torcs_scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <tuple>
#include <unordered_map>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "rendering/read_image.h"
#include "rendering/rgba_image.h"

namespace relocd {
namespace {

constexpr float kAlphaCutoff = 0.5F;
constexpr float kLeafTranslucency = 0.25F;
constexpr float kWallReflectance = 0.85F;  ///< Of the brightest texture: none is a perfect white.
constexpr float kCreaseCosine = 0.7F;      ///< Edges that are sharper are not smoothed.
constexpr float kCoincidenceShiftM = 0.005F;
constexpr float kSmallestAreaM2 = 1e-8F;

Eigen::Vector3f ToWorld(const Eigen::Vector3f& p_A) {
  return {p_A.x(), -p_A.z(), p_A.y()};
}

/// A triangle of an object.
struct ObjectTriangle {
  const Ac3dSurface* surface = nullptr;
  std::array<Ac3dCorner, 3> corners;
};

/// Fans and strips; lines have none.
void AppendTriangles(const Ac3dSurface& surface, std::vector<ObjectTriangle>& triangles) {
  const auto& corners = surface.corners;
  for (std::size_t i = 2; i < corners.size(); ++i) {
    if (surface.kind == Ac3dSurface::Kind::kPolygon) {
      triangles.push_back({&surface, {corners[0], corners[i - 1], corners[i]}});
    } else if (surface.kind == Ac3dSurface::Kind::kTriangleStrip) {
      // Each second triangle goes round the other way.
      const std::size_t odd = i % 2;
      triangles.push_back({&surface, {corners[i - 2 + odd], corners[i - 1 - odd], corners[i]}});
    }
  }
}

std::vector<ObjectTriangle> TrianglesOf(const Ac3dObject& object) {
  std::vector<ObjectTriangle> triangles;
  for (const Ac3dSurface& surface : object.surfaces) {
    AppendTriangles(surface, triangles);
  }
  return triangles;
}

/// An object's vertices and normals in W.
class PlacedObject {
 public:
  PlacedObject(const Ac3dModel& model, std::size_t index) {
    const Ac3dObject& object = model.objects[index];
    const Eigen::Affine3f X_AO = model.PlaceOf(index);
    for (const Eigen::Vector3f& vertex : object.vertices) {
      positions_.push_back(ToWorld(X_AO * vertex));
    }
    for (const Eigen::Vector3f& normal : object.normals) {
      normals_.push_back(ToWorld(X_AO.linear() * normal));
    }
  }

  [[nodiscard]] const std::vector<Eigen::Vector3f>& positions() const { return positions_; }

  [[nodiscard]] std::array<Eigen::Vector3f, 3> CornersOf(const ObjectTriangle& triangle) const {
    const auto& [a, b, c] = triangle.corners;
    return {positions_[a.vertex], positions_[b.vertex], positions_[c.vertex]};
  }

  /// Twice the triangle's area long.
  [[nodiscard]] Eigen::Vector3f CrossOf(const ObjectTriangle& triangle) const {
    const auto [a, b, c] = CornersOf(triangle);
    return (b - a).cross(c - a);
  }

  /// Makes normals of the smooth triangles round each vertex, where the file has none.
  void MakeNormals(const std::vector<ObjectTriangle>& triangles) {
    if (!normals_.empty()) return;
    crosses_.resize(positions_.size());
    for (const ObjectTriangle& triangle : triangles) {
      if (!triangle.surface->is_smooth) continue;
      for (const Ac3dCorner& corner : triangle.corners) {
        crosses_[corner.vertex].push_back(CrossOf(triangle));
      }
    }
  }

  /// Of length 1, at a vertex of a triangle with the normal `face`.
  [[nodiscard]] Eigen::Vector3f NormalAt(std::uint32_t vertex, const Eigen::Vector3f& face) const {
    Eigen::Vector3f sum = Eigen::Vector3f::Zero();
    if (!normals_.empty()) sum = normals_[vertex];
    for (std::size_t i = 0; normals_.empty() && i < crosses_[vertex].size(); ++i) {
      const Eigen::Vector3f& cross = crosses_[vertex][i];
      if (cross.dot(face) > kCreaseCosine * cross.norm()) sum += cross;
    }
    const float length = sum.norm();
    // A normal that does not fit its face is worse than none.
    return length > 0.0F && sum.dot(face) > 0.3F * length ? Eigen::Vector3f(sum / length) : face;
  }

 private:
  std::vector<Eigen::Vector3f> positions_;
  std::vector<Eigen::Vector3f> normals_;               ///< Empty, or one for each vertex.
  std::vector<std::vector<Eigen::Vector3f>> crosses_;  ///< For each vertex, if there are none.
};

/// Puts all surfaces into one mesh and a scene's materials.
class SceneBuilder {
 public:
  SceneBuilder(const Ac3dModel& model, const TorcsSceneOptions& options, const std::string& path)
      : model_(model), options_(options), path_(path) {}

  Result<Scene> Build() {
    for (std::size_t i = 0; i < model_.objects.size(); ++i) {
      if (model_.objects[i].surfaces.empty()) continue;
      if (auto ok = AddObject(i); !ok) return ok.error();
    }
    SeparateCoincident();
    for (const bool with_holes : {false, true}) {
      Mesh part = Part(with_holes);
      if (part.triangles.empty()) continue;
      const std::uint32_t mesh = scene_.AddMesh(std::move(part));
      scene_.instances.push_back({.mesh = mesh});
    }
    return std::move(scene_);
  }

 private:
  /// What rain does to a surface.
  enum class Wetting { kNone, kDarker, kShining };
  /// Texture (-1: none), material of the model.
  using MaterialKey = std::tuple<int, std::uint32_t, Wetting>;

  Result<void> AddObject(std::size_t index);
  void AddTriangle(const Ac3dObject& object,
                   const PlacedObject& placed,
                   const ObjectTriangle& triangle,
                   int texture);
  Result<int> TextureOf(const Ac3dObject& object);
  std::uint32_t MaterialOf(const Ac3dObject& object, const MaterialKey& key);
  [[nodiscard]] Wetting WettingOf(const std::array<Eigen::Vector3f, 3>& p_Ws,
                                  const Eigen::Vector3f& normal) const;
  void SeparateCoincident();
  [[nodiscard]] std::array<float, 9> SortedCorners(std::size_t triangle) const;
  void MoveAlongNormal(std::size_t triangle, float distance_m);
  [[nodiscard]] Mesh Part(bool with_holes) const;

  const Ac3dModel& model_;
  const TorcsSceneOptions& options_;
  const std::string& path_;
  Scene scene_;
  Mesh mesh_;
  std::map<std::string, int> textures_;
  std::map<MaterialKey, std::uint32_t> materials_;
};

Result<int> SceneBuilder::TextureOf(const Ac3dObject& object) {
  if (object.texture.empty()) return -1;
  if (const auto known = textures_.find(object.texture); known != textures_.end())
    return known->second;
  const auto context = [&] {
    return fmt::format("{}: line {}: object '{}'", path_, object.line, object.name);
  };
  // What a file of unknown origin asks for stays in the folders.
  const std::string file = std::filesystem::path(object.texture).filename().string();
  for (const std::string& folder : options_.texture_folders) {
    const std::string image_path = folder + "/" + file;
    std::error_code ignored;
    if (file.empty() || !std::filesystem::is_regular_file(image_path, ignored)) continue;
    auto image = ReadRgbaImage(image_path);
    if (!image) return std::move(image).error().WithContext(context());
    const RgbaImage fitting = ResampleToPowersOfTwo(std::move(image).value(), Texture::kMaxSide);
    auto texture = Texture::Create(fitting.width, fitting.height, fitting.pixels);
    if (!texture) return std::move(texture).error().WithContext(context());
    const auto number = static_cast<int>(scene_.AddTexture(std::move(texture).value()));
    textures_.emplace(object.texture, number);
    return number;
  }
  return Error{ErrorKind::kInvalidInput,
               fmt::format("{}: texture '{}' is in none of the folders {}",
                           context(),
                           object.texture,
                           fmt::join(options_.texture_folders, ", "))};
}

bool HasWord(const std::string& text, std::initializer_list<const char*> words) {
  std::string lower = text;
  std::transform(lower.begin(), lower.end(), lower.begin(), [](char c) {
    return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  });
  return std::any_of(words.begin(), words.end(), [&](const char* word) {
    return lower.find(word) != std::string::npos;
  });
}

SceneBuilder::Wetting SceneBuilder::WettingOf(const std::array<Eigen::Vector3f, 3>& p_Ws,
                                              const Eigen::Vector3f& normal) const {
  constexpr float kSmallestUp = 0.7F;
  if (std::abs(normal.z()) < kSmallestUp) return Wetting::kNone;
  const bool is_road = options_.is_road && options_.is_road((p_Ws[0] + p_Ws[1] + p_Ws[2]) / 3.0F);
  return is_road ? Wetting::kShining : Wetting::kDarker;
}

std::uint32_t SceneBuilder::MaterialOf(const Ac3dObject& object, const MaterialKey& key) {
  if (const auto known = materials_.find(key); known != materials_.end()) return known->second;
  const auto& [texture, number, wetting] = key;
  Material material{.name = object.texture, .texture = texture};
  if (texture >= 0) {
    material.albedo = Eigen::Array3f::Constant(kWallReflectance);
    const bool has_holes = !scene_.textures[static_cast<std::size_t>(texture)].is_opaque();
    if (has_holes) material.alpha_cutoff = kAlphaCutoff;
    if (has_holes && HasWord(object.texture, {"tree", "bush", "leaf"}))
      material.translucency = kLeafTranslucency;
  } else {
    const Ac3dMaterial& plain = model_.materials[number];
    material.name = plain.name;
    for (Eigen::Index i = 0; i < 3; ++i) {
      material.albedo[i] =
          LinearFromSrgb(static_cast<std::uint8_t>(std::lround(255.0F * plain.colour[i])));
    }
  }
  if (wetting != Wetting::kNone) material.wet_darkening = 0.4F;
  const bool is_loose =
      HasWord(object.texture, {"dirt", "earth", "gras", "gravel", "mud", "sand", "snow"});
  if (wetting == Wetting::kShining && !is_loose) material.wet_reflectivity = 0.04F;
  const std::uint32_t index = scene_.AddMaterial(std::move(material));
  materials_.emplace(key, index);
  return index;
}

Result<void> SceneBuilder::AddObject(std::size_t index) {
  const Ac3dObject& object = model_.objects[index];
  const auto texture = TextureOf(object);
  if (!texture) return texture.error();
  PlacedObject placed(model_, index);
  const auto triangles = TrianglesOf(object);
  placed.MakeNormals(triangles);
  for (const ObjectTriangle& triangle : triangles) {
    AddTriangle(object, placed, triangle, *texture);
  }
  return {};
}

void SceneBuilder::AddTriangle(const Ac3dObject& object,
                               const PlacedObject& placed,
                               const ObjectTriangle& triangle,
                               int texture) {
  const Eigen::Vector3f cross = placed.CrossOf(triangle);
  if (!(cross.norm() > kSmallestAreaM2)) return;
  const Eigen::Vector3f face = cross.normalized();
  const auto p_Ws = placed.CornersOf(triangle);
  const std::uint32_t material = MaterialOf(
      object, {texture, texture >= 0 ? 0U : triangle.surface->material, WettingOf(p_Ws, face)});
  const auto first = static_cast<std::uint32_t>(mesh_.positions.size());
  for (std::size_t i = 0; i < 3; ++i) {
    const Ac3dCorner& corner = triangle.corners.at(i);
    const Eigen::Vector2f uv =
        corner.uv.cwiseProduct(object.texture_repeat) + object.texture_offset;
    mesh_.positions.push_back(p_Ws.at(i));
    mesh_.normals.push_back(triangle.surface->is_smooth ? placed.NormalAt(corner.vertex, face)
                                                        : face);
    mesh_.uvs.emplace_back(uv.x(), 1.0F - uv.y());
  }
  mesh_.triangles.push_back({first, first + 1, first + 2});
  mesh_.triangle_materials.push_back(material);
}

/// What is the same of two triangles that coincide.
std::array<float, 9> SceneBuilder::SortedCorners(std::size_t triangle) const {
  std::array<std::array<float, 3>, 3> corners{};
  for (std::size_t k = 0; k < 3; ++k) {
    const Eigen::Vector3f& p = mesh_.positions[mesh_.triangles[triangle].at(k)];
    corners.at(k) = {p.x(), p.y(), p.z()};
  }
  std::sort(corners.begin(), corners.end());
  std::array<float, 9> sorted{};
  for (std::size_t k = 0; k < 9; ++k) {
    sorted.at(k) = corners.at(k / 3).at(k % 3);
  }
  return sorted;
}

void SceneBuilder::MoveAlongNormal(std::size_t triangle, float distance_m) {
  const auto& [a, b, c] = mesh_.triangles[triangle];
  const Eigen::Vector3f p_WA = mesh_.positions[a];
  const Eigen::Vector3f shift =
      distance_m * (mesh_.positions[b] - p_WA).cross(mesh_.positions[c] - p_WA).normalized();
  for (const std::uint32_t vertex : {a, b, c}) {
    mesh_.positions[vertex] += shift;
  }
}

/// Boards have a front and a back in one place, each drawn from its own side. Rays would find
/// either.
void SceneBuilder::SeparateCoincident() {
  std::map<std::array<float, 9>, std::vector<std::size_t>> triangles_at;
  for (std::size_t i = 0; i < mesh_.triangles.size(); ++i) {
    triangles_at[SortedCorners(i)].push_back(i);
  }
  for (const auto& [corners, triangles] : triangles_at) {
    for (std::size_t n = 0; triangles.size() > 1 && n < triangles.size(); ++n) {
      MoveAlongNormal(triangles[n], kCoincidenceShiftM * static_cast<float>(n + 1));
    }
  }
}

/// What has holes is traced more slowly, and so is a mesh of its own. Triangles share no vertices.
Mesh SceneBuilder::Part(bool with_holes) const {
  Mesh part;
  for (std::size_t i = 0; i < mesh_.triangles.size(); ++i) {
    const std::uint32_t material = mesh_.triangle_materials[i];
    if ((scene_.materials[material].alpha_cutoff > 0.0F) != with_holes) continue;
    const auto first = static_cast<std::uint32_t>(part.positions.size());
    for (const std::uint32_t vertex : mesh_.triangles[i]) {
      part.positions.push_back(mesh_.positions[vertex]);
      part.normals.push_back(mesh_.normals[vertex]);
      part.uvs.push_back(mesh_.uvs[vertex]);
    }
    part.triangles.push_back({first, first + 1, first + 2});
    part.triangle_materials.push_back(material);
  }
  return part;
}

}  // namespace

std::vector<Eigen::Vector3f> VerticesInWorld(const Ac3dModel& model) {
  std::vector<Eigen::Vector3f> vertices;
  for (std::size_t i = 0; i < model.objects.size(); ++i) {
    const PlacedObject placed(model, i);
    vertices.insert(vertices.end(), placed.positions().begin(), placed.positions().end());
  }
  return vertices;
}

std::vector<std::array<Eigen::Vector3f, 3>> TrianglesInWorld(const Ac3dModel& model) {
  std::vector<std::array<Eigen::Vector3f, 3>> triangles;
  for (std::size_t i = 0; i < model.objects.size(); ++i) {
    const PlacedObject placed(model, i);
    for (const ObjectTriangle& triangle : TrianglesOf(model.objects[i])) {
      triangles.push_back(placed.CornersOf(triangle));
    }
  }
  return triangles;
}

Result<Scene> MakeTorcsScene(const Ac3dModel& model,
                             const TorcsSceneOptions& options,
                             const std::string& path) {
  return SceneBuilder(model, options, path).Build();
}

}  // namespace relocd
