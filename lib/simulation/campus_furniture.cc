#include "simulation/campus_furniture.h"

#include <cmath>
#include <numbers>
#include <utility>

#include "rendering/mesh_builder.h"
#include "simulation/campus_textures.h"

namespace relocd {
namespace {

using Eigen::Vector3f;

constexpr float kFoot = 0.3F;  // How deep things reach into the ground, which is not level, m.
constexpr float kSegment = 2.0F;

Mesh MakeLampPost(const CampusMaterials& m) {
  MeshBuilder b;
  b.AddCylinder({0.0F, 0.0F, -kFoot}, 0.10F, 0.09F, 1.2F, 10, m.dark_metal);
  b.AddCylinder({0.0F, 0.0F, 0.9F}, 0.065F, 0.045F, 4.2F, 10, m.dark_metal);
  b.AddBox({-0.04F, -0.03F, 5.08F}, {1.0F, 0.03F, 5.14F}, m.dark_metal);
  b.AddBox({0.8F, -0.13F, 5.08F}, {1.5F, 0.13F, 5.19F}, m.dark_metal);
  b.AddBox({0.86F, -0.10F, 5.055F}, {1.44F, 0.10F, 5.079F}, m.lamp_glow);
  return b.Take();
}

Mesh MakeBench(const CampusMaterials& m) {
  MeshBuilder b;
  for (const float y : {-0.7F, 0.62F}) {
    b.AddBox({-0.22F, y, -kFoot}, {0.22F, y + 0.08F, 0.42F}, m.dark_metal);
    b.AddBox({-0.28F, y, 0.42F}, {-0.2F, y + 0.08F, 0.88F}, m.dark_metal);
  }
  for (int i = 0; i < 4; ++i) {
    const float x = -0.2F + 0.115F * static_cast<float>(i);
    b.AddBox({x, -0.9F, 0.42F}, {x + 0.095F, 0.9F, 0.46F}, m.fence_wood, 0.8F);
  }
  for (int i = 0; i < 3; ++i) {
    const float z = 0.53F + 0.12F * static_cast<float>(i);
    b.AddBox({-0.2F, -0.9F, z}, {-0.165F, 0.9F, z + 0.1F}, m.fence_wood, 0.8F);
  }
  return b.Take();
}

Mesh MakeBin(const CampusMaterials& m) {
  MeshBuilder b;
  b.AddCylinder({0.0F, 0.0F, -kFoot}, 0.04F, 0.04F, 0.7F, 6, m.metal);
  b.AddCylinder({0.0F, 0.0F, 0.25F}, 0.19F, 0.23F, 0.62F, 12, m.dark_metal);
  b.AddCylinder({0.0F, 0.0F, 0.86F}, 0.25F, 0.25F, 0.05F, 12, m.metal);
  b.AddCylinder({0.0F, 0.0F, 0.91F}, 0.25F, 0.02F, 0.06F, 12, m.metal);
  b.AddPicture(
      {0.22F, -0.1F, 0.5F}, {0.0F, 0.2F, 0.0F}, {0.02F, 0.0F, 0.2F}, m.posters, kPosters.Part(5));
  return b.Take();
}

Mesh MakeBollard(const CampusMaterials& m) {
  MeshBuilder b;
  b.AddCylinder({0.0F, 0.0F, -kFoot}, 0.07F, 0.065F, kFoot + 0.78F, 9, m.dark_metal);
  b.AddCylinder({0.0F, 0.0F, 0.78F}, 0.08F, 0.08F, 0.06F, 9, m.white_wood);
  b.AddCylinder({0.0F, 0.0F, 0.84F}, 0.065F, 0.01F, 0.05F, 9, m.dark_metal);
  return b.Take();
}

Mesh MakeLetterBox(const CampusMaterials& m, Scene& scene) {
  const std::uint32_t paint =
      AddTintedMaterial("letter box", m.metal_texture, {0.72F, 0.60F, 0.20F}, scene);
  MeshBuilder b;
  b.AddBox({-0.12F, -0.12F, -kFoot}, {0.12F, 0.12F, 0.7F}, m.metal);
  b.AddBox({-0.25F, -0.3F, 0.7F}, {0.25F, 0.3F, 1.35F}, paint, 0.8F);
  b.AddBox({0.25F, -0.2F, 1.18F}, {0.262F, 0.2F, 1.22F}, m.dark_metal);
  b.AddPicture({0.258F, -0.15F, 0.82F},
               {0.0F, 0.3F, 0.0F},
               {0.0F, 0.0F, 0.25F},
               m.posters,
               kPosters.Part(9));
  return b.Take();
}

Mesh MakeCabinet(const CampusMaterials& m, Scene& scene) {
  const std::uint32_t paint =
      AddTintedMaterial("cabinet", m.plaster_texture, {0.62F, 0.66F, 0.60F}, scene);
  MeshBuilder b;
  b.AddBox({-0.2F, -0.55F, -kFoot}, {0.2F, 0.55F, 0.12F}, m.concrete);
  b.AddBox({-0.17F, -0.52F, 0.12F}, {0.17F, 0.52F, 1.15F}, paint, 2.0F);
  b.AddBox({-0.2F, -0.55F, 1.15F}, {0.2F, 0.55F, 1.2F}, paint, 2.0F);
  b.AddBox({0.17F, -0.008F, 0.14F}, {0.175F, 0.008F, 1.13F}, m.dark_metal);
  b.AddPicture(
      {0.176F, 0.06F, 0.45F}, {0.0F, 0.4F, 0.0F}, {0.0F, 0.0F, 0.55F}, m.posters, kPosters.Part(2));
  b.AddPicture({0.176F, -0.45F, 0.6F},
               {0.0F, 0.22F, 0.0F},
               {0.0F, 0.0F, 0.3F},
               m.posters,
               kPosters.Part(12));
  return b.Take();
}

Mesh MakePlanter(const CampusMaterials& m, CampusRandom random) {
  MeshBuilder b;
  b.AddBox({-0.45F, -0.45F, -kFoot}, {0.45F, 0.45F, 0.55F}, m.concrete, 2.0F);
  b.AddBox({-0.4F, -0.4F, 0.55F}, {0.4F, 0.4F, 0.56F}, m.soil, 2.0F);
  for (int i = 0; i < 34; ++i) {
    const float x = random.Uniform(-0.35F, 0.35F);
    const float y = random.Uniform(-0.35F, 0.35F);
    const float angle = random.Uniform(0.0F, 3.1F);
    const float z = random.Uniform(0.5F, 0.75F);
    const Vector3f u(0.44F * std::cos(angle), 0.44F * std::sin(angle), 0.0F);
    b.AddPicture(Vector3f(x, y, z) - 0.5F * u,
                 u,
                 {0.1F * std::sin(angle), 0.1F * std::cos(angle), 0.42F},
                 i % 3 == 0 ? m.leaves[1] : m.hedge);
  }
  return b.Take();
}

/// An upright wheel in the x-z plane.
void AddBicycleWheel(const Vector3f& centre, std::uint32_t material, MeshBuilder& b) {
  constexpr int kSides = 14;
  constexpr float kRadius = 0.33F;
  constexpr float kTyre = 0.035F;
  for (int i = 0; i < kSides; ++i) {
    const float angle = 2.0F * std::numbers::pi_v<float> * static_cast<float>(i) / kSides;
    Eigen::Affine3f X_BW = Eigen::Affine3f::Identity();
    X_BW.translation() = centre;
    X_BW.linear() = Eigen::AngleAxisf(angle, Vector3f::UnitY()).toRotationMatrix();
    b.AddBox({-0.082F, -0.5F * kTyre, kRadius - kTyre},
             {0.082F, 0.5F * kTyre, kRadius},
             material,
             1.0F,
             X_BW);
    if (i % 2 == 0)
      b.AddBox({-0.004F, -0.004F, 0.0F}, {0.004F, 0.004F, kRadius - kTyre}, material, 1.0F, X_BW);
  }
}

void AddBar(
    const Vector3f& from, const Vector3f& to, float half, std::uint32_t material, MeshBuilder& b) {
  Eigen::Affine3f X_BR = Eigen::Affine3f::Identity();
  X_BR.translation() = from;
  X_BR.linear() = Eigen::Quaternionf::FromTwoVectors(Vector3f::UnitZ(), (to - from).normalized())
                      .toRotationMatrix();
  b.AddBox({-half, -half, 0.0F}, {half, half, (to - from).norm()}, material, 1.0F, X_BR);
}

Mesh MakeBicycleStand(const CampusMaterials& m, CampusRandom random, Scene& scene) {
  MeshBuilder b;
  for (int i = 0; i < 4; ++i) {
    const float y = 0.8F * static_cast<float>(i);
    AddBar({-0.3F, y, -kFoot}, {-0.3F, y, 0.8F}, 0.025F, m.metal, b);
    AddBar({0.3F, y, -kFoot}, {0.3F, y, 0.8F}, 0.025F, m.metal, b);
    AddBar({-0.3F, y, 0.78F}, {0.3F, y, 0.78F}, 0.025F, m.metal, b);
    if (!random.Chance(0.75)) continue;
    const float grey = random.Uniform(0.2F, 0.6F);
    const std::uint32_t paint = AddTintedMaterial(
        "bicycle",
        m.metal_texture,
        {grey + random.Uniform(-0.1F, 0.25F), grey, grey + random.Uniform(-0.1F, 0.2F)},
        scene);
    const float w = y + 0.12F;
    AddBicycleWheel({-0.52F, w, 0.33F}, m.dark_metal, b);
    AddBicycleWheel({0.52F, w, 0.33F}, m.dark_metal, b);
    AddBar({-0.52F, w, 0.33F}, {-0.15F, w, 0.75F}, 0.017F, paint, b);
    AddBar({-0.52F, w, 0.33F}, {-0.02F, w, 0.3F}, 0.017F, paint, b);
    AddBar({-0.02F, w, 0.3F}, {-0.18F, w, 0.9F}, 0.017F, paint, b);
    AddBar({-0.15F, w, 0.75F}, {0.38F, w, 0.8F}, 0.017F, paint, b);
    AddBar({-0.02F, w, 0.3F}, {0.38F, w, 0.75F}, 0.017F, paint, b);
    AddBar({0.52F, w, 0.33F}, {0.34F, w, 1.02F}, 0.017F, paint, b);
    b.AddBox({0.28F, w - 0.27F, 1.0F}, {0.32F, w + 0.27F, 1.03F}, m.dark_metal);
    b.AddBox({-0.31F, w - 0.06F, 0.9F}, {-0.07F, w + 0.06F, 0.95F}, m.dark_metal);
  }
  return b.Take();
}

Mesh MakeShelter(const CampusMaterials& m) {
  MeshBuilder b;
  for (const float y : {-1.9F, 1.82F}) {
    b.AddBox({-0.6F, y, -kFoot}, {-0.52F, y + 0.08F, 2.4F}, m.dark_metal);
    b.AddBox({0.5F, y, -kFoot}, {0.58F, y + 0.08F, 2.4F}, m.dark_metal);
  }
  b.AddBox({-0.75F, -2.1F, 2.4F}, {0.85F, 2.1F, 2.52F}, m.dark_metal);
  b.AddBox({-0.5F, -1.4F, 0.42F}, {-0.15F, 1.0F, 0.47F}, m.fence_wood, 0.8F);
  b.AddBox({-0.45F, -1.2F, -kFoot}, {-0.4F, -1.1F, 0.42F}, m.dark_metal);
  b.AddBox({-0.45F, 0.7F, -kFoot}, {-0.4F, 0.8F, 0.42F}, m.dark_metal);
  b.AddBox({-0.58F, -1.8F, 0.12F}, {-0.55F, 1.8F, 0.18F}, m.metal);
  b.AddBox({-0.58F, -1.8F, 2.2F}, {-0.55F, 1.8F, 2.26F}, m.metal);
  b.AddBox({-0.5F, 1.74F, 0.2F}, {0.5F, 1.86F, 2.2F}, m.dark_metal);
  b.AddPicture(
      {-0.42F, 1.735F, 0.3F}, {0.84F, 0.0F, 0.0F}, {0.0F, 0.0F, 1.8F}, m.posters, kPosters.Part(3));
  b.AddPicture(
      {0.42F, 1.865F, 0.3F}, {-0.84F, 0.0F, 0.0F}, {0.0F, 0.0F, 1.8F}, m.posters, kPosters.Part(7));
  return b.Take();
}

Mesh MakeAdvertisingColumn(const CampusMaterials& m) {
  constexpr int kSides = 12;
  constexpr float kRadius = 0.6F;
  MeshBuilder b;
  b.AddCylinder(
      {0.0F, 0.0F, -kFoot}, kRadius + 0.06F, kRadius + 0.06F, 0.55F, 16, m.concrete, 2.0F);
  b.AddCylinder({0.0F, 0.0F, 0.2F}, kRadius, kRadius, 2.5F, 24, m.stone, 3.0F);
  b.AddCylinder({0.0F, 0.0F, 2.7F}, kRadius + 0.15F, kRadius + 0.12F, 0.12F, 16, m.dark_metal);
  b.AddCylinder({0.0F, 0.0F, 2.82F}, kRadius + 0.12F, 0.02F, 0.5F, 16, m.dark_metal);
  for (int i = 0; i < kSides; ++i) {
    const float angle = 2.0F * std::numbers::pi_v<float> * static_cast<float>(i) / kSides;
    const Vector3f out(std::cos(angle), std::sin(angle), 0.0F);
    const Vector3f along(-out.y(), out.x(), 0.0F);
    for (const float z : {0.45F, 1.55F}) {
      const auto poster = static_cast<std::size_t>(i * 5 + (z > 1.0F ? 3 : 0));
      b.AddPicture((kRadius + 0.012F) * out - 0.15F * along + Vector3f(0.0F, 0.0F, z),
                   0.3F * along,
                   {0.0F, 0.0F, 1.0F},
                   m.posters,
                   kPosters.Part(poster));
    }
  }
  return b.Take();
}

Mesh MakeWirePole(const CampusMaterials& m) {
  MeshBuilder b;
  b.AddCylinder({0.0F, 0.0F, -kFoot}, 0.14F, 0.09F, 7.6F + kFoot, 9, m.dark_wood, 1.2F);
  b.AddBox({-0.05F, -0.9F, 7.0F}, {0.05F, 0.9F, 7.12F}, m.dark_wood);
  for (const float y : {-0.8F, 0.0F, 0.8F})
    b.AddCylinder({0.0F, y, 7.12F}, 0.04F, 0.03F, 0.16F, 6, m.white_wood);
  b.AddCylinder({0.24F, 0.0F, 5.8F}, 0.17F, 0.17F, 0.6F, 8, m.metal);
  return b.Take();
}

Mesh MakeSign(std::size_t sign, const CampusMaterials& m) {
  constexpr float kHalf = 0.32F;
  MeshBuilder b;
  b.AddCylinder({0.0F, 0.0F, -kFoot}, 0.032F, 0.032F, 2.75F + kFoot, 8, m.metal);
  const float z = 2.05F;
  b.AddPicture({0.042F, -kHalf, z},
               {0.0F, 2.0F * kHalf, 0.0F},
               {0.0F, 0.0F, 2.0F * kHalf},
               m.plates,
               kPlates.Part(sign));
  // The same outline from behind, in grey, would need a picture of its own: a plate does.
  b.AddBox({0.034F, -0.2F, z + 0.12F}, {0.040F, 0.2F, z + 0.52F}, m.metal);
  return b.Take();
}

Mesh MakePicketFence(const CampusMaterials& m, Scene& scene) {
  const std::uint32_t paint =
      AddTintedMaterial("fence paint", m.plank_texture, {0.93F, 0.92F, 0.88F}, scene);
  MeshBuilder b;
  b.AddBox({0.0F, -0.05F, -kFoot}, {0.09F, 0.05F, 1.0F}, paint, 0.9F);
  for (const float z : {0.25F, 0.72F})
    b.AddBox({0.0F, -0.02F, z}, {kSegment, 0.02F, z + 0.07F}, paint, 0.9F);
  for (int i = 0; i < 13; ++i) {
    const float x = 0.12F + 0.147F * static_cast<float>(i);
    b.AddBox({x, -0.045F, 0.08F}, {x + 0.085F, -0.02F, 0.9F}, paint, 0.9F);
  }
  return b.Take();
}

Mesh MakeRailFence(const CampusMaterials& m) {
  MeshBuilder b;
  b.AddBox({0.0F, -0.03F, -kFoot}, {0.06F, 0.03F, 1.25F}, m.dark_metal);
  for (const float z : {0.15F, 1.1F})
    b.AddBox({0.0F, -0.015F, z}, {kSegment, 0.015F, z + 0.04F}, m.dark_metal);
  for (int i = 1; i < 16; ++i) {
    const float x = 0.125F * static_cast<float>(i) + 0.02F;
    b.AddBox({x, -0.009F, 0.12F}, {x + 0.018F, 0.009F, 1.22F}, m.dark_metal);
  }
  return b.Take();
}

Mesh MakeBoardFence(const CampusMaterials& m) {
  MeshBuilder b;
  b.AddBox({0.0F, -0.06F, -kFoot}, {0.1F, 0.06F, 1.9F}, m.concrete);
  b.AddBox({0.0F, -0.02F, -0.05F}, {kSegment, 0.02F, 1.75F}, m.fence_wood, kTilePlanks);
  b.AddBox({0.0F, -0.05F, 1.75F}, {kSegment, 0.05F, 1.79F}, m.fence_wood, kTilePlanks);
  return b.Take();
}

Mesh MakeLowWall(const CampusMaterials& m) {
  MeshBuilder b;
  b.AddBox({0.0F, -0.12F, -kFoot}, {kSegment, 0.12F, 0.62F}, m.bricks[0], kTileBrick);
  b.AddBox({0.0F, -0.16F, 0.62F}, {kSegment, 0.16F, 0.7F}, m.stone, kTilePlaster);
  return b.Take();
}

}  // namespace

CampusFurniture MakeCampusFurniture(const CampusMaterials& materials,
                                    CampusRandom random,
                                    Scene& scene) {
  CampusFurniture f;
  f.lamp_post = scene.AddMesh(MakeLampPost(materials));
  f.bench = scene.AddMesh(MakeBench(materials));
  f.bin = scene.AddMesh(MakeBin(materials));
  f.bollard = scene.AddMesh(MakeBollard(materials));
  f.letter_box = scene.AddMesh(MakeLetterBox(materials, scene));
  f.cabinet = scene.AddMesh(MakeCabinet(materials, scene));
  f.planter = scene.AddMesh(MakePlanter(materials, random.Fork(1)));
  f.bicycle_stand = scene.AddMesh(MakeBicycleStand(materials, random.Fork(2), scene));
  f.shelter = scene.AddMesh(MakeShelter(materials));
  f.advertising_column = scene.AddMesh(MakeAdvertisingColumn(materials));
  f.wire_pole = scene.AddMesh(MakeWirePole(materials));
  for (std::size_t sign = 0; sign < f.signs.size(); ++sign)
    f.signs.at(sign) = scene.AddMesh(MakeSign(sign, materials));
  f.picket_fence = scene.AddMesh(MakePicketFence(materials, scene));
  f.rail_fence = scene.AddMesh(MakeRailFence(materials));
  f.board_fence = scene.AddMesh(MakeBoardFence(materials));
  f.low_wall = scene.AddMesh(MakeLowWall(materials));
  return f;
}

}  // namespace relocd
