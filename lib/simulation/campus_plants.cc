#include "simulation/campus_plants.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace relocd {
namespace {

using Eigen::Vector2f;
using Eigen::Vector3f;

constexpr float kPi = std::numbers::pi_v<float>;

Vector3f RandomDirection(CampusRandom& random) {
  const float z = random.Uniform(-1.0F, 1.0F);
  const float angle = random.Uniform(0.0F, 2.0F * kPi);
  const float radius = std::sqrt(1.0F - z * z);
  return {radius * std::cos(angle), radius * std::sin(angle), z};
}

Vector3f AnyNormalTo(const Vector3f& direction) {
  return direction.cross(std::abs(direction.x()) < 0.6F ? Vector3f::UnitX() : Vector3f::UnitY())
      .normalized();
}

/// A place on the axis of a trunk or branch.
struct BranchPlace {
  Vector3f position = Vector3f::Zero();
  float radius = 0.1F;
};

/// Grows plants as meshes.
class PlantBuilder {
 public:
  explicit PlantBuilder(CampusRandom random) : random_(random) {}

  [[nodiscard]] CampusRandom& random() { return random_; }
  Mesh Take() { return std::move(mesh_); }

  void AddBranch(const BranchPlace& from,
                 const BranchPlace& to,
                 int sides,
                 std::uint32_t material) {
    const Vector3f axis = (to.position - from.position).normalized();
    const Vector3f side = AnyNormalTo(axis);
    const Vector3f other = axis.cross(side);
    const auto first = static_cast<std::uint32_t>(mesh_.positions.size());
    const float length = (to.position - from.position).norm();
    for (int i = 0; i <= sides; ++i) {
      const float part = static_cast<float>(i) / static_cast<float>(sides);
      const float angle = 2.0F * kPi * part;
      const Vector3f outward = std::cos(angle) * side + std::sin(angle) * other;
      AddVertex(from.position + from.radius * outward, outward, {part, 0.0F});
      AddVertex(to.position + to.radius * outward, outward, {part, 0.7F * length});
    }
    for (std::uint32_t i = 0; i < static_cast<std::uint32_t>(sides); ++i) {
      const std::uint32_t a = first + 2 * i;
      AddFace({a, a + 2, a + 3}, material);
      AddFace({a, a + 3, a + 1}, material);
    }
  }

  /// A square of leaves with some orientation, which is lit as if it were part of a round crown.
  void AddCard(const Vector3f& centre,
               float half,
               const Vector3f& lit_from,
               std::uint32_t material) {
    const Vector3f normal = (RandomDirection(random_) + 0.5F * lit_from).normalized();
    const Vector3f u = half * AnyNormalTo(normal);
    AddCardAlong(centre, u, half * normal.cross(u).normalized(), lit_from, material);
  }

  void AddCardAlong(const Vector3f& centre,
                    const Vector3f& u,
                    const Vector3f& v,
                    const Vector3f& lit_from,
                    std::uint32_t material) {
    const std::uint32_t a = AddVertex(centre - u - v, lit_from, {0.0F, 1.0F});
    AddVertex(centre + u - v, lit_from, {1.0F, 1.0F});
    AddVertex(centre + u + v, lit_from, {1.0F, 0.0F});
    AddVertex(centre - u + v, lit_from, {0.0F, 0.0F});
    AddFace({a, a + 1, a + 2}, material);
    AddFace({a, a + 2, a + 3}, material);
  }

  /// Leaves within a ball, more of them near its surface.
  void AddLeafBall(const Vector3f& centre,
                   const Vector3f& radii,
                   int cards,
                   float half,
                   std::uint32_t material) {
    for (int i = 0; i < cards; ++i) {
      const Vector3f direction = RandomDirection(random_);
      const float out = std::cbrt(random_.Uniform(0.15F, 1.0F));
      const Vector3f at = centre + out * radii.cwiseProduct(direction);
      const Vector3f lit_from = (direction + Vector3f(0.0F, 0.0F, 0.35F)).normalized();
      AddCard(at, half * random_.Uniform(0.75F, 1.25F), lit_from, material);
    }
  }

 private:
  std::uint32_t AddVertex(const Vector3f& position, const Vector3f& normal, const Vector2f& uv) {
    mesh_.positions.push_back(position);
    mesh_.normals.push_back(normal);
    mesh_.uvs.push_back(uv);
    return static_cast<std::uint32_t>(mesh_.positions.size() - 1);
  }

  void AddFace(const std::array<std::uint32_t, 3>& triangle, std::uint32_t material) {
    mesh_.triangles.push_back(triangle);
    mesh_.triangle_materials.push_back(material);
  }

  Mesh mesh_;
  CampusRandom random_;
};

/// The shape of a broad-leaved tree, m.
struct TreeShape {
  float trunk_height = 2.6F;  ///< Up to the lowest branches.
  float trunk_radius = 0.17F;
  float crown_height = 6.0F;
  float crown_radius = 2.8F;
  int branches = 8;
  int cards_per_branch = 26;
  float card_half = 0.54F;
  std::uint32_t bark = 0;
  std::uint32_t leaves = 0;
};

Mesh GrowTree(const TreeShape& shape, CampusRandom random) {
  PlantBuilder plant(random);
  CampusRandom& draw = plant.random();
  BranchPlace base{Vector3f(0.0F, 0.0F, -0.3F), 1.35F * shape.trunk_radius};
  std::vector<BranchPlace> trunk{base};
  const float top = shape.trunk_height + 0.6F * shape.crown_height;
  for (int i = 1; i <= 4; ++i) {
    const float part = static_cast<float>(i) / 4.0F;
    const float dx = draw.Uniform(-0.14F, 0.14F);
    const float dy = draw.Uniform(-0.14F, 0.14F);
    trunk.push_back(
        {Vector3f(trunk.back().position.x() + dx, trunk.back().position.y() + dy, top * part),
         shape.trunk_radius * (1.05F - 0.8F * part)});
    plant.AddBranch(trunk[static_cast<std::size_t>(i - 1)], trunk.back(), 7, shape.bark);
  }
  const Vector3f centre(0.0F, 0.0F, shape.trunk_height + 0.5F * shape.crown_height);
  for (int i = 0; i < shape.branches; ++i) {
    const float part = (static_cast<float>(i) + 0.5F) / static_cast<float>(shape.branches);
    const float angle = 2.4F * static_cast<float>(i) + draw.Uniform(-0.4F, 0.4F);
    const float up = shape.trunk_height + shape.crown_height * (0.12F + 0.76F * part);
    const float bulge = std::sqrt(std::max(0.15F, 1.0F - std::pow(2.0F * part - 0.9F, 2.0F)));
    const float out = 0.62F * shape.crown_radius * bulge * draw.Uniform(0.8F, 1.15F);
    const Vector3f end(out * std::cos(angle), out * std::sin(angle), up);
    const std::size_t from = part < 0.5F ? 2 : 3;
    const BranchPlace start{trunk[from].position, 0.5F * trunk[from].radius};
    plant.AddBranch(start, {end, 0.025F}, 5, shape.bark);
    const float ball = shape.crown_radius * draw.Uniform(0.42F, 0.58F);
    plant.AddLeafBall(
        end, {ball, ball, 0.85F * ball}, shape.cards_per_branch, shape.card_half, shape.leaves);
  }
  plant.AddLeafBall(
      centre,
      {0.8F * shape.crown_radius, 0.8F * shape.crown_radius, 0.46F * shape.crown_height},
      2 * shape.cards_per_branch,
      shape.card_half,
      shape.leaves);
  return plant.Take();
}

Mesh GrowSpruce(const CampusMaterials& materials, CampusRandom random) {
  PlantBuilder plant(random);
  CampusRandom& draw = plant.random();
  const float height = draw.Uniform(8.5F, 11.0F);
  plant.AddBranch({Vector3f(0.0F, 0.0F, -0.3F), 0.2F},
                  {Vector3f(0.0F, 0.0F, height), 0.02F},
                  6,
                  materials.bark);
  constexpr int kTiers = 13;
  for (int tier = 0; tier < kTiers; ++tier) {
    const float part = static_cast<float>(tier) / kTiers;
    const float z = 1.3F + (height - 1.2F) * part;
    const float reach = 2.3F * (1.0F - part) + 0.25F;
    const int arms = tier < 8 ? 9 : 6;
    for (int arm = 0; arm < arms; ++arm) {
      const float angle = 2.0F * kPi * static_cast<float>(arm) / static_cast<float>(arms) +
                          0.7F * static_cast<float>(tier) + draw.Uniform(-0.2F, 0.2F);
      const Vector3f out(std::cos(angle), std::sin(angle), -0.32F);
      const Vector3f side(-std::sin(angle), std::cos(angle), 0.0F);
      const Vector3f lit_from = Vector3f(out.x(), out.y(), 0.5F).normalized();
      const float length = reach * draw.Uniform(0.85F, 1.1F);
      for (const float tilt : {-0.35F, 0.35F}) {
        const Vector3f v =
            (0.38F * length + 0.15F) * (side + tilt * Vector3f::UnitZ()).normalized();
        plant.AddCardAlong(Vector3f(0.0F, 0.0F, z) + 0.5F * length * out,
                           0.55F * length * out,
                           v,
                           lit_from,
                           materials.leaves[3]);
      }
    }
  }
  return plant.Take();
}

TreeShape ShapeOf(TreeKind kind,
                  const CampusMaterials& m,
                  std::uint32_t birch_bark,
                  CampusRandom& random) {
  TreeShape shape;
  shape.bark = m.bark;
  shape.leaves = m.leaves[0];
  const float size = random.Uniform(0.88F, 1.15F);
  switch (kind) {
    case TreeKind::kBirch:
      shape = {.trunk_height = 2.6F,
               .trunk_radius = 0.12F,
               .crown_height = 7.0F,
               .crown_radius = 2.0F,
               .branches = 9,
               .cards_per_branch = 20,
               .card_half = 0.47F,
               .bark = birch_bark,
               .leaves = m.leaves[1]};
      break;
    case TreeKind::kPlane:
      shape = {.trunk_height = 3.0F,
               .trunk_radius = 0.26F,
               .crown_height = 7.0F,
               .crown_radius = 4.0F,
               .branches = 11,
               .cards_per_branch = 28,
               .card_half = 0.69F,
               .bark = m.bark,
               .leaves = m.leaves[2]};
      break;
    case TreeKind::kYoung:
      shape = {.trunk_height = 2.3F,
               .trunk_radius = 0.07F,
               .crown_height = 2.9F,
               .crown_radius = 1.35F,
               .branches = 6,
               .cards_per_branch = 16,
               .card_half = 0.40F,
               .bark = m.bark,
               .leaves = m.leaves[0]};
      break;
    case TreeKind::kPoplar:
      shape = {.trunk_height = 1.5F,
               .trunk_radius = 0.2F,
               .crown_height = 12.0F,
               .crown_radius = 1.5F,
               .branches = 14,
               .cards_per_branch = 17,
               .card_half = 0.54F,
               .bark = m.bark,
               .leaves = m.leaves[1]};
      break;
    default:
      break;
  }
  shape.crown_height *= size;
  shape.crown_radius *= size;
  return shape;
}

Mesh GrowBush(const CampusMaterials& materials, std::size_t kind, CampusRandom random) {
  PlantBuilder plant(random);
  const float radius = plant.random().Uniform(0.5F, 0.85F);
  const std::uint32_t leaves = kind % 2 == 0 ? materials.hedge : materials.leaves[1];
  for (int i = 0; i < 4; ++i) {
    const float x = plant.random().Uniform(-0.3F, 0.3F);
    const float y = plant.random().Uniform(-0.3F, 0.3F);
    plant.AddBranch({Vector3f(0.1F * x, 0.1F * y, -0.1F), 0.03F},
                    {Vector3f(x, y, radius), 0.01F},
                    4,
                    materials.bark);
  }
  plant.AddLeafBall(
      {0.0F, 0.0F, 0.85F * radius}, {radius, radius, 0.85F * radius}, 80, 0.26F, leaves);
  return plant.Take();
}

/// Hedges are a dark core behind leaves that stick out.
Mesh GrowHedge(float height,
               std::uint32_t core,
               const CampusMaterials& materials,
               CampusRandom random) {
  constexpr float kLength = 2.0F;
  constexpr float kHalfWidth = 0.38F;
  PlantBuilder plant(random);
  CampusRandom& draw = plant.random();
  const Vector3f middle(0.5F * kLength, 0.0F, 0.5F * height - 0.1F);
  for (const float side : {-1.0F, 1.0F}) {
    plant.AddCardAlong(middle + Vector3f(0.0F, side * (kHalfWidth - 0.12F), 0.0F),
                       {0.5F * kLength * side, 0.0F, 0.0F},
                       {0.0F, 0.0F, 0.5F * height},
                       {0.0F, side, 0.0F},
                       core);
  }
  plant.AddCardAlong({0.5F * kLength, 0.0F, height - 0.2F},
                     {0.5F * kLength, 0.0F, 0.0F},
                     {0.0F, kHalfWidth - 0.12F, 0.0F},
                     Vector3f::UnitZ(),
                     core);
  const int cards = static_cast<int>(66.0F * height);
  for (int i = 0; i < cards; ++i) {
    const float x = draw.Uniform(0.0F, kLength);
    const float around = draw.Uniform(-1.0F, 1.0F);
    const float half = draw.Uniform(0.16F, 0.25F);
    const float side = around > 0.0F ? 1.0F : -1.0F;
    const bool is_top = std::abs(around) < 0.3F;
    const float y =
        is_top ? around / 0.3F * kHalfWidth : side * (kHalfWidth + draw.Uniform(-0.09F, 0.03F));
    const float z =
        is_top ? height - draw.Uniform(0.02F, 0.12F) : draw.Uniform(0.02F, height - 0.05F);
    const Vector3f lit_from =
        is_top ? Vector3f(0.0F, 0.3F * side, 0.95F) : Vector3f(0.0F, 0.9F * side, 0.43F);
    plant.AddCard({x, y, z}, half, lit_from, materials.hedge);
  }
  return plant.Take();
}

Mesh GrowTufts(const CampusMaterials& materials, CampusRandom random) {
  PlantBuilder plant(random);
  CampusRandom& draw = plant.random();
  for (int i = 0; i < 16; ++i) {
    const float angle = draw.Uniform(0.0F, 2.0F * kPi);
    const float out = 1.3F * std::sqrt(draw.Unit());
    const float height = draw.Uniform(0.07F, 0.2F);
    const float turn = draw.Uniform(0.0F, kPi);
    const Vector3f at(out * std::cos(angle), out * std::sin(angle), height - 0.02F);
    for (const float half_turn : {0.0F, 0.5F * kPi}) {
      const Vector3f u(std::cos(turn + half_turn), std::sin(turn + half_turn), 0.0F);
      plant.AddCardAlong(
          at, 1.1F * height * u, {0.0F, 0.0F, height}, Vector3f::UnitZ(), materials.grass_tuft);
    }
  }
  return plant.Take();
}

}  // namespace

CampusPlants MakeCampusPlants(const CampusMaterials& materials, CampusRandom random, Scene& scene) {
  constexpr std::size_t kVariants = 3;
  const std::uint32_t birch_bark =
      AddTintedMaterial("birch bark", materials.plaster_texture, {0.86F, 0.85F, 0.80F}, scene);
  const std::uint32_t core = AddTintedMaterial("hedge core", -1, {0.18F, 0.23F, 0.13F}, scene);
  CampusPlants plants;
  for (std::size_t kind = 0; kind < kTreeKinds; ++kind) {
    for (std::size_t variant = 0; variant < kVariants; ++variant) {
      const CampusRandom own = random.Fork(10 * kind + variant);
      CampusRandom draw = own.Fork(1);
      const auto tree = static_cast<TreeKind>(kind);
      Mesh mesh = tree == TreeKind::kSpruce
                      ? GrowSpruce(materials, own)
                      : GrowTree(ShapeOf(tree, materials, birch_bark, draw), own);
      plants.trees.at(kind).push_back(scene.AddMesh(std::move(mesh)));
    }
  }
  for (std::size_t i = 0; i < 4; ++i)
    plants.bushes.push_back(scene.AddMesh(GrowBush(materials, i, random.Fork(100 + i))));
  plants.hedge = scene.AddMesh(GrowHedge(1.7F, core, materials, random.Fork(110)));
  plants.low_hedge = scene.AddMesh(GrowHedge(0.85F, core, materials, random.Fork(111)));
  for (std::size_t i = 0; i < 3; ++i)
    plants.tufts.push_back(scene.AddMesh(GrowTufts(materials, random.Fork(120 + i))));
  return plants;
}

}  // namespace relocd
