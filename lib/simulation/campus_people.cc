#include "simulation/campus_people.h"

#include <array>
#include <cmath>
#include <numbers>
#include <span>
#include <utility>

#include "rendering/mesh_builder.h"

namespace relocd {
namespace {

using Eigen::Vector2f;
using Eigen::Vector3f;

/// A level cut through a limb: an ellipse.
struct LimbRing {
  Vector3f centre = Vector3f::Zero();
  float along = 0.1F;   ///< Half its size along x, m.
  float across = 0.1F;  ///< Along y.
};

struct Clothes {
  std::uint32_t skin = 0;
  std::uint32_t hair = 0;
  std::uint32_t jacket = 0;
  std::uint32_t trousers = 0;
  std::uint32_t shoes = 0;
  bool has_skirt = false;
  bool has_bag = false;
  bool has_long_hair = false;
};

class PersonBuilder {
 public:
  /// Rings from below upwards.
  void AddLimb(std::span<const LimbRing> rings, std::uint32_t material) {
    constexpr int kSides = 10;
    std::vector<Vector3f> points;
    for (const LimbRing& ring : rings) {
      for (int i = 0; i <= kSides; ++i) {
        const float angle =
            2.0F * std::numbers::pi_v<float> * static_cast<float>(i % kSides) / kSides;
        points.push_back(ring.centre + Vector3f(ring.along * std::cos(angle),
                                                ring.across * std::sin(angle),
                                                0.0F));
      }
    }
    builder_.AddGrid(points, static_cast<int>(rings.size()), kSides + 1, material, 0.5F);
  }

  void AddBall(const Vector3f& centre, const Vector3f& radii, std::uint32_t material) {
    std::array<LimbRing, 7> rings;
    for (std::size_t i = 0; i < rings.size(); ++i) {
      const float angle = std::numbers::pi_v<float> * (static_cast<float>(i) / 6.0F - 0.5F);
      const float wide = std::max(0.02F, std::cos(angle));
      rings.at(i) = {centre + Vector3f(0.0F, 0.0F, radii.z() * std::sin(angle)),
                     radii.x() * wide,
                     radii.y() * wide};
    }
    AddLimb(rings, material);
  }

  void AddBox(const Vector3f& low, const Vector3f& high, std::uint32_t material) {
    builder_.AddBox(low, high, material, 0.5F);
  }

  /// @param stride  where the foot is ahead of the hip, m.
  void AddLeg(float side, float stride, const Clothes& clothes) {
    const float y = 0.09F * side;
    const float knee = 0.5F * stride + 0.06F;
    const float lift = stride < 0.0F ? 0.06F : 0.0F;
    const std::array<LimbRing, 5> rings{{{{stride - 0.02F, y, 0.07F + lift}, 0.055F, 0.05F},
                                         {{0.8F * stride, y, 0.25F + lift}, 0.06F, 0.055F},
                                         {{knee, y, 0.48F}, 0.066F, 0.062F},
                                         {{0.3F * knee, y, 0.72F}, 0.085F, 0.085F},
                                         {{0.0F, 0.8F * y, 0.92F}, 0.11F, 0.1F}}};
    AddLimb(rings, clothes.has_skirt ? clothes.skin : clothes.trousers);
    AddBox({stride - 0.09F, y - 0.045F, lift},
           {stride + 0.17F, y + 0.045F, 0.085F + lift},
           clothes.shoes);
  }

  void AddArm(float side, float swing, const Clothes& clothes) {
    const float y = 0.235F * side;
    const std::array<LimbRing, 4> rings{{{{swing + 0.05F, y, 0.84F}, 0.04F, 0.035F},
                                         {{0.55F * swing, 1.06F * y, 1.08F}, 0.05F, 0.045F},
                                         {{0.1F * swing, y, 1.32F}, 0.058F, 0.052F},
                                         {{0.0F, 0.78F * y, 1.44F}, 0.06F, 0.055F}}};
    AddLimb(rings, clothes.jacket);
    AddBall({swing + 0.06F, y, 0.8F}, {0.05F, 0.03F, 0.06F}, clothes.skin);
  }

  void AddTrunk(const Clothes& clothes) {
    const std::array<LimbRing, 6> torso{{{{0.0F, 0.0F, 0.82F}, 0.12F, 0.17F},
                                         {{0.0F, 0.0F, 0.98F}, 0.115F, 0.165F},
                                         {{0.01F, 0.0F, 1.15F}, 0.115F, 0.16F},
                                         {{0.02F, 0.0F, 1.33F}, 0.125F, 0.19F},
                                         {{0.01F, 0.0F, 1.45F}, 0.09F, 0.17F},
                                         {{0.01F, 0.0F, 1.50F}, 0.05F, 0.06F}}};
    AddLimb(torso, clothes.jacket);
    if (clothes.has_skirt) {
      const std::array<LimbRing, 3> skirt{{{{0.0F, 0.0F, 0.5F}, 0.23F, 0.22F},
                                           {{0.0F, 0.0F, 0.75F}, 0.17F, 0.19F},
                                           {{0.0F, 0.0F, 0.98F}, 0.125F, 0.17F}}};
      AddLimb(skirt, clothes.trousers);
    }
    if (clothes.has_bag) AddBox({-0.27F, -0.14F, 1.0F}, {-0.11F, 0.14F, 1.42F}, clothes.shoes);
  }

  void AddHead(const Clothes& clothes) {
    const std::array<LimbRing, 2> neck{
        {{{0.01F, 0.0F, 1.46F}, 0.055F, 0.055F}, {{0.025F, 0.0F, 1.58F}, 0.05F, 0.05F}}};
    AddLimb(neck, clothes.skin);
    AddBall({0.035F, 0.0F, 1.65F}, {0.095F, 0.076F, 0.125F}, clothes.skin);
    AddBall({0.015F, 0.0F, 1.69F}, {0.102F, 0.086F, 0.105F}, clothes.hair);
    if (clothes.has_long_hair) AddBall({-0.055F, 0.0F, 1.57F}, {0.06F, 0.09F, 0.17F}, clothes.hair);
  }

  Mesh Take() { return builder_.Take(); }

 private:
  MeshBuilder builder_;
};

}  // namespace

std::vector<std::uint32_t> AddPeopleMeshes(const CampusMaterials& materials,
                                           CampusRandom random,
                                           Scene& scene) {
  const std::array<Eigen::Array3f, 6> cloths{{{0.20F, 0.24F, 0.33F},
                                              {0.46F, 0.17F, 0.18F},
                                              {0.72F, 0.68F, 0.58F},
                                              {0.24F, 0.31F, 0.25F},
                                              {0.18F, 0.18F, 0.19F},
                                              {0.55F, 0.57F, 0.62F}}};
  const std::array<Eigen::Array3f, 3> skins{
      {{0.85F, 0.68F, 0.58F}, {0.68F, 0.49F, 0.38F}, {0.45F, 0.31F, 0.24F}}};
  const std::array<Eigen::Array3f, 4> hairs{
      {{0.16F, 0.12F, 0.10F}, {0.38F, 0.27F, 0.18F}, {0.62F, 0.52F, 0.36F}, {0.55F, 0.54F, 0.53F}}};
  const auto cloth = [&](const Eigen::Array3f& srgb) {
    return AddTintedMaterial("cloth", materials.plaster_texture, srgb, scene);
  };
  std::vector<std::uint32_t> meshes;
  for (std::size_t i = 0; i < 6; ++i) {
    Clothes clothes;
    clothes.skin = cloth(skins.at(i % skins.size()));
    clothes.hair = cloth(hairs.at(i % hairs.size()));
    clothes.jacket = cloth(cloths.at((i + random.Index(2)) % cloths.size()));
    clothes.trousers = cloth(cloths.at((i + 3) % cloths.size()));
    clothes.shoes = materials.dark_metal;
    clothes.has_skirt = i == 1 || i == 4;
    clothes.has_long_hair = i % 2 == 1;
    clothes.has_bag = i % 3 == 0;
    const float stride = random.Uniform(0.16F, 0.3F);
    PersonBuilder person;
    person.AddLeg(1.0F, stride, clothes);
    person.AddLeg(-1.0F, -stride, clothes);
    person.AddArm(1.0F, -0.6F * stride, clothes);
    person.AddArm(-1.0F, 0.6F * stride, clothes);
    person.AddTrunk(clothes);
    person.AddHead(clothes);
    meshes.push_back(scene.AddMesh(person.Take()));
  }
  return meshes;
}

}  // namespace relocd
