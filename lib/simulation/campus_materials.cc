#include "simulation/campus_materials.h"

#include <cmath>
#include <utility>

#include "rendering/texture.h"
#include "simulation/campus_pictures.h"
#include "simulation/campus_textures.h"

namespace relocd {
namespace {

constexpr float kLeafTranslucency = 0.35F;
constexpr float kGlassReflectivity = 0.06F;

int AddTexture(Texture texture, Scene& scene) {
  return static_cast<int>(scene.AddTexture(std::move(texture)));
}

std::uint32_t Add(const std::string& name, int texture, float albedo, Scene& scene) {
  return scene.AddMaterial(
      {.name = name, .texture = texture, .albedo = Eigen::Array3f::Constant(albedo)});
}

/// A surface that rain makes dark and shiny.
void MakeWettable(std::uint32_t material, float reflectivity, float darkening, Scene& scene) {
  scene.materials[material].wet_reflectivity = reflectivity;
  scene.materials[material].wet_darkening = darkening;
}

std::uint32_t AddCutOut(const std::string& name, int texture, float cutoff, Scene& scene) {
  const std::uint32_t material = Add(name, texture, 1.0F, scene);
  scene.materials[material].alpha_cutoff = cutoff;
  return material;
}

std::uint32_t AddFoliage(const std::string& name, int texture, Scene& scene) {
  const std::uint32_t material = AddCutOut(name, texture, 0.4F, scene);
  scene.materials[material].translucency = kLeafTranslucency;
  return material;
}

void AddRoadMaterials(const TileNoise& noise,
                      CampusRandom random,
                      Scene& scene,
                      CampusMaterials& m) {
  const int asphalt = AddTexture(MakeAsphaltTexture(noise), scene);
  m.asphalt = Add("asphalt", asphalt, 0.95F, scene);
  m.asphalt_old = Add("old asphalt", asphalt, 1.0F, scene);
  scene.materials[m.asphalt_old].albedo = {1.0F, 0.98F, 0.95F};
  m.asphalt_new = Add("new asphalt", asphalt, 0.55F, scene);
  m.tar = Add("tar", asphalt, 0.3F, scene);
  m.flat_roof = Add("roofing felt", asphalt, 0.7F, scene);
  m.paving =
      Add("paving", AddTexture(MakePavingTexture(noise, random.Fork(1)), scene), 0.9F, scene);
  m.setts = Add("setts", AddTexture(MakeSettsTexture(noise, random.Fork(2)), scene), 0.95F, scene);
  m.gutter = Add("gutter", scene.materials[m.setts].texture, 0.75F, scene);
  const int concrete = AddTexture(MakeConcreteTexture(noise), scene);
  m.concrete = Add("concrete", concrete, 0.9F, scene);
  m.kerb = Add("kerb", concrete, 1.0F, scene);
  m.road_paint =
      AddCutOut("road paint", AddTexture(MakeRoadPaintTexture(noise), scene), 0.5F, scene);
  m.road_details =
      AddCutOut("road details", AddTexture(MakeRoadDetails(noise), scene), 0.5F, scene);
  m.cracks = AddCutOut("cracks", AddTexture(MakeCracks(random.Fork(3)), scene), 0.5F, scene);
  for (const std::uint32_t material :
       {m.asphalt, m.asphalt_old, m.asphalt_new, m.tar, m.road_details, m.cracks})
    MakeWettable(material, 0.05F, 0.45F, scene);
  for (const std::uint32_t material : {m.paving, m.setts, m.gutter, m.kerb, m.road_paint})
    MakeWettable(material, 0.04F, 0.35F, scene);
}

void AddGreenMaterials(const TileNoise& noise,
                       CampusRandom random,
                       Scene& scene,
                       CampusMaterials& m) {
  const int grass = AddTexture(MakeGrassTexture(noise), scene);
  m.grass = Add("grass", grass, 0.85F, scene);
  m.meadow = Add("meadow", grass, 1.0F, scene);
  scene.materials[m.meadow].albedo = {1.0F, 0.93F, 0.75F};
  m.gravel = Add("gravel", scene.materials[m.asphalt].texture, 1.0F, scene);
  m.soil =
      AddTintedMaterial("soil", scene.materials[m.asphalt].texture, {0.75F, 0.62F, 0.5F}, scene);
  m.hills = Add("hills", AddTexture(MakeForestTexture(noise), scene), 0.8F, scene);
  m.bark = Add("bark", AddTexture(MakeBarkTexture(noise), scene), 0.9F, scene);
  const auto leaves = [&](const char* name,
                          float length,
                          float slimness,
                          const Paint& dark,
                          const Paint& light,
                          std::uint64_t part) {
    return AddFoliage(
        name,
        AddTexture(MakeLeaves(length, slimness, dark, light, random.Fork(part)), scene),
        scene);
  };
  m.leaves[0] = leaves("lime leaves",
                       0.105F,
                       0.62F,
                       OpaquePaint(0.22F, 0.31F, 0.13F),
                       OpaquePaint(0.40F, 0.48F, 0.22F),
                       11);
  m.leaves[1] = leaves("birch leaves",
                       0.075F,
                       0.6F,
                       OpaquePaint(0.30F, 0.36F, 0.15F),
                       OpaquePaint(0.53F, 0.54F, 0.26F),
                       12);
  m.leaves[2] = leaves("plane leaves",
                       0.125F,
                       0.78F,
                       OpaquePaint(0.19F, 0.28F, 0.14F),
                       OpaquePaint(0.36F, 0.42F, 0.20F),
                       13);
  m.leaves[3] = leaves("pine needles",
                       0.24F,
                       0.12F,
                       OpaquePaint(0.13F, 0.21F, 0.13F),
                       OpaquePaint(0.27F, 0.34F, 0.20F),
                       14);
  m.hedge = leaves("hedge leaves",
                   0.11F,
                   0.55F,
                   OpaquePaint(0.15F, 0.24F, 0.11F),
                   OpaquePaint(0.31F, 0.40F, 0.18F),
                   15);
  m.ivy = leaves(
      "ivy", 0.14F, 0.85F, OpaquePaint(0.16F, 0.24F, 0.12F), OpaquePaint(0.31F, 0.39F, 0.19F), 16);
  m.grass_tuft = AddFoliage("grass tuft", AddTexture(MakeGrassTuft(random.Fork(17)), scene), scene);
}

void AddWallMaterials(const TileNoise& noise,
                      CampusRandom random,
                      Scene& scene,
                      CampusMaterials& m) {
  const Paint mortar = GreyPaint(0.58F, 0.03F);
  const int red = AddTexture(
      MakeBrickTexture(noise,
                       {OpaquePaint(0.50F, 0.27F, 0.21F), OpaquePaint(0.66F, 0.42F, 0.32F)},
                       mortar,
                       random.Fork(21)),
      scene);
  const int buff = AddTexture(
      MakeBrickTexture(noise,
                       {OpaquePaint(0.55F, 0.46F, 0.33F), OpaquePaint(0.74F, 0.65F, 0.48F)},
                       GreyPaint(0.66F, 0.03F),
                       random.Fork(22)),
      scene);
  m.bricks = {Add("red brick", red, 0.95F, scene),
              Add("buff brick", buff, 0.95F, scene),
              AddTintedMaterial("brown brick", red, {0.80F, 0.78F, 0.76F}, scene)};
  m.plaster_texture = AddTexture(MakePlasterTexture(noise), scene);
  m.clapboard_texture = AddTexture(MakeClapboardTexture(noise, random.Fork(23)), scene);
  m.stone = AddTintedMaterial("stone", m.plaster_texture, {0.80F, 0.77F, 0.71F}, scene);
  const int tiles = AddTexture(MakeRoofTileTexture(noise, random.Fork(24)), scene);
  m.roofs = {Add("roof tiles", tiles, 1.0F, scene),
             Add("slate", AddTexture(MakeSlateTexture(noise, random.Fork(25)), scene), 1.0F, scene),
             AddTintedMaterial("dark roof tiles", tiles, {0.72F, 0.70F, 0.74F}, scene)};
  m.plank_texture = AddTexture(MakePlankTexture(noise, random.Fork(26)), scene);
  m.white_wood = AddTintedMaterial("white wood", m.plaster_texture, {0.93F, 0.93F, 0.91F}, scene);
  m.dark_wood = AddTintedMaterial("dark wood", m.plank_texture, {0.55F, 0.45F, 0.38F}, scene);
  m.fence_wood = AddTintedMaterial("fence wood", m.plank_texture, {0.85F, 0.76F, 0.66F}, scene);
  m.stains = AddCutOut("stains", AddTexture(MakeStains(noise), scene), 0.5F, scene);
}

void AddPictureMaterials(const TileNoise& noise,
                         CampusRandom random,
                         Scene& scene,
                         CampusMaterials& m) {
  const int windows = AddTexture(MakeWindowPictures(noise, random.Fork(31)), scene);
  m.window = Add("window", windows, 0.9F, scene);
  m.lit_window = Add("lit window", windows, 0.9F, scene);
  scene.materials[m.lit_window].emission = {0.10F, 0.068F, 0.034F};
  m.shop_window =
      Add("shop window", AddTexture(MakeShopPictures(noise, random.Fork(32)), scene), 0.9F, scene);
  scene.materials[m.shop_window].emission = {0.07F, 0.058F, 0.04F};
  for (const std::uint32_t material : {m.window, m.lit_window, m.shop_window})
    scene.materials[material].reflectivity = kGlassReflectivity;
  m.shop_sign =
      Add("shop sign", AddTexture(MakeShopSigns(noise, random.Fork(33)), scene), 0.95F, scene);
  m.posters = Add("posters", AddTexture(MakePosters(noise, random.Fork(34)), scene), 0.9F, scene);
  m.doors = Add("doors", AddTexture(MakeDoorPictures(noise, random.Fork(35)), scene), 0.9F, scene);
  scene.materials[m.doors].reflectivity = 0.02F;
  m.plates = AddCutOut("plates", AddTexture(MakePlates(random.Fork(36)), scene), 0.5F, scene);
}

void AddCarMaterials(CampusRandom random, Scene& scene, CampusMaterials& m) {
  m.car_glass = Add("car glass", -1, 0.025F, scene);
  scene.materials[m.car_glass].reflectivity = 0.08F;
  m.dark_plastic =
      AddTintedMaterial("dark plastic", m.plaster_texture, {0.17F, 0.17F, 0.18F}, scene);
  m.rubber = Add("rubber", -1, 0.018F, scene);
  m.head_light = Add("head light", -1, 0.65F, scene);
  scene.materials[m.head_light].reflectivity = kGlassReflectivity;
  m.tail_light = AddTintedMaterial("tail light", -1, {0.55F, 0.08F, 0.07F}, scene);
  scene.materials[m.tail_light].reflectivity = kGlassReflectivity;
  m.licence_plates =
      Add("licence plates", AddTexture(MakeLicencePlates(random.Fork(41)), scene), 0.9F, scene);
}

}  // namespace

std::uint32_t AddTintedMaterial(const std::string& name,
                                int texture,
                                const Eigen::Array3f& srgb,
                                Scene& scene) {
  const auto linear = [](float value) { return std::pow(value, 2.2F); };
  return scene.AddMaterial({.name = name, .texture = texture, .albedo = srgb.unaryExpr(linear)});
}

CampusMaterials MakeCampusMaterials(CampusRandom random, Scene& scene) {
  const TileNoise noise(random.Fork(0));
  CampusMaterials m;
  AddRoadMaterials(noise, random, scene, m);
  AddGreenMaterials(noise, random, scene, m);
  AddWallMaterials(noise, random, scene, m);
  AddPictureMaterials(noise, random, scene, m);
  m.metal_texture = AddTexture(MakeMetalTexture(noise), scene);
  m.metal = AddTintedMaterial("galvanised metal", m.metal_texture, {0.72F, 0.73F, 0.74F}, scene);
  m.dark_metal = AddTintedMaterial("dark metal", m.metal_texture, {0.30F, 0.32F, 0.32F}, scene);
  m.rusty_metal = AddTintedMaterial("rusty metal", m.metal_texture, {0.58F, 0.44F, 0.36F}, scene);
  for (const std::uint32_t material : {m.metal, m.dark_metal})
    scene.materials[material].reflectivity = 0.03F;
  AddCarMaterials(random, scene, m);
  m.lamp_glow = Add("lamp glass", -1, 0.8F, scene);
  scene.materials[m.lamp_glow].emission = {9.0F, 7.2F, 4.6F};
  return m;
}

}  // namespace relocd
