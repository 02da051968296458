#include "rendering/scene.h"

#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "rendering/mesh_builder.h"
#include "rendering/test_scenes.h"

namespace relocd {
namespace {

using testing::HasSubstr;

Scene BoxScene() {
  Scene scene;
  MeshBuilder builder;
  builder.AddBox({-1, -1, 0}, {1, 1, 2}, AddPlain(scene, 0.5F));
  Place(scene, builder);
  return scene;
}

TEST(SceneTest, CountsTrianglesOfAllInstances) {
  Scene scene = BoxScene();
  EXPECT_EQ(scene.CountTriangles(), 12U);
  scene.instances.push_back({.mesh = 0});
  EXPECT_EQ(scene.CountTriangles(), 24U);
  EXPECT_TRUE(scene.Validate());
}

TEST(SceneTest, SaysWhichIndexLeadsNowhere) {
  Scene scene = BoxScene();
  scene.instances.push_back({.mesh = 3});
  EXPECT_THAT(scene.Validate().error().message, HasSubstr("instance 1: mesh 3, must be below 1"));

  scene = BoxScene();
  scene.meshes[0].triangles[2][1] = 99;
  EXPECT_THAT(scene.Validate().error().message,
              HasSubstr("mesh 0: a triangle has vertex 99, must be below 24"));

  scene = BoxScene();
  scene.meshes[0].triangle_materials[5] = 7;
  EXPECT_THAT(scene.Validate().error().message,
              HasSubstr("mesh 0: a triangle has material 7, must be below 1"));

  scene = BoxScene();
  scene.materials[0].texture = 0;
  EXPECT_THAT(scene.Validate().error().message, HasSubstr("material 0: texture 0"));
}

TEST(SceneTest, RefusesCountsThatDoNotFit) {
  Scene scene = BoxScene();
  scene.meshes[0].uvs.pop_back();
  EXPECT_THAT(scene.Validate().error().message,
              HasSubstr("mesh 0: 23 texture coordinates for 24 positions"));
  scene = BoxScene();
  scene.meshes[0].normals.pop_back();
  EXPECT_FALSE(scene.Validate());
  scene = BoxScene();
  scene.meshes[0].triangle_materials.pop_back();
  EXPECT_FALSE(scene.Validate());
}

TEST(SceneTest, RefusesNumbersThatAreNotFinite) {
  Scene scene = BoxScene();
  scene.meshes[0].positions[4].y() = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT(scene.Validate().error().message, HasSubstr("mesh 0: a number is not finite"));
  scene = BoxScene();
  scene.instances[0].X_WM.translation().x() = std::numeric_limits<float>::infinity();
  EXPECT_THAT(scene.Validate().error().message, HasSubstr("instance 0"));
}

TEST(MeshBuilderTest, ABoxIsClosedAndFacesOutwards) {
  const Scene scene = BoxScene();
  const Mesh& mesh = scene.meshes[0];
  // The volume by the divergence theorem, 2 x 2 x 2, is positive only if all faces look outwards.
  float volume = 0.0F;
  for (const auto& [a, b, c] : mesh.triangles) {
    volume += mesh.positions[a].dot(mesh.positions[b].cross(mesh.positions[c])) / 6.0F;
    const Eigen::Vector3f normal =
        (mesh.positions[b] - mesh.positions[a]).cross(mesh.positions[c] - mesh.positions[a]);
    EXPECT_GT(normal.dot(mesh.normals[a]), 0.0F);
  }
  EXPECT_NEAR(volume, 8.0F, 1e-5F);
}

TEST(MeshBuilderTest, TexturesKeepTheirScaleAndStandUpright) {
  MeshBuilder builder;
  builder.AddQuad({0, 0, 0}, {6, 0, 0}, {0, 0, 3}, 0, 2.0F);
  const Mesh& mesh = builder.mesh();
  EXPECT_FLOAT_EQ((mesh.uvs[1] - mesh.uvs[0]).x(), 3.0F);
  EXPECT_FLOAT_EQ((mesh.uvs[3] - mesh.uvs[0]).y(), -1.5F);
  EXPECT_TRUE(mesh.normals[0].isApprox(Eigen::Vector3f(0, -1, 0)));
}

}  // namespace
}  // namespace relocd
