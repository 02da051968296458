#include "simulation/torcs_scene.h"

#include <tuple>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "simulation/torcs_test_track.h"
#include "support/temporary_folder.h"

namespace relocd {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

/// An object with one triangle in the plane z = 0 of W, seen from above, or from below.
std::string TriangleObject(const std::string& name, const std::string& texture, bool is_up) {
  return "OBJECT poly\nname \"" + name + "\"\n" +
         (texture.empty() ? "" : "texture \"" + texture + "\"\n") +
         "numvert 3\n0 0 0\n1 0 0\n0 0 -1\nnumsurf 1\nSURF 0x00\nmat 0\nrefs 3\n" +
         (is_up ? "0 0 0\n1 1 0\n2 0 1\n" : "0 0 0\n2 0 1\n1 1 0\n") + "kids 0\n";
}

Ac3dModel Model(const std::string& objects, int count) {
  const std::string text =
      "AC3Db\nMATERIAL \"red\" rgb 1 0 0.5 amb 1 1 1 emis 0 0 0 spec 0 0 0 shi 0 trans 0\n"
      "OBJECT world\nkids " +
      std::to_string(count) + "\n" + objects;
  return ParseAc3d(text, "a.ac").value();
}

Eigen::Vector3f FaceNormal(const Mesh& mesh, std::size_t triangle) {
  const auto& [a, b, c] = mesh.triangles[triangle];
  return (mesh.positions[b] - mesh.positions[a])
      .cross(mesh.positions[c] - mesh.positions[a])
      .normalized();
}

class MakeTorcsSceneTest : public ::testing::Test {
 protected:
  MakeTorcsSceneTest() {
    folder_.Write("a/grass.rgb", TorcsTestTrack::OnePixel('\x40', '\xff'));
    folder_.Write("b/grass.rgb", TorcsTestTrack::OnePixel('\x80', '\xff'));
    folder_.Write("b/tree.rgb", TorcsTestTrack::OnePixel('\x20', '\x30'));
    options_.texture_folders = {folder_.path() + "/a", folder_.path() + "/b"};
  }

  TemporaryFolder folder_;
  TorcsSceneOptions options_;
};

TEST_F(MakeTorcsSceneTest, TurnsAxesAndImagesUpright) {
  const auto scene =
      MakeTorcsScene(Model(TriangleObject("T", "grass.rgb", true), 1), options_, "a.ac");
  ASSERT_TRUE(scene) << scene.error().message;
  ASSERT_TRUE(scene->Validate());
  ASSERT_EQ(scene->instances.size(), 1U);
  const Mesh& mesh = scene->meshes[0];
  ASSERT_EQ(mesh.triangles.size(), 1U);
  EXPECT_EQ(mesh.positions[2], Eigen::Vector3f(0, 1, 0));
  EXPECT_TRUE(FaceNormal(mesh, 0).isApprox(Eigen::Vector3f::UnitZ()));
  EXPECT_EQ(mesh.normals[0], Eigen::Vector3f::UnitZ());
  EXPECT_EQ(mesh.uvs[0], Eigen::Vector2f(0, 1));
  EXPECT_EQ(mesh.uvs[2], Eigen::Vector2f(0, 0));
}

TEST_F(MakeTorcsSceneTest, TakesTexturesFromTheFirstFolderThatHasThem) {
  const auto scene =
      MakeTorcsScene(Model(TriangleObject("T", "grass.rgb", true), 1), options_, "a.ac");
  ASSERT_TRUE(scene);
  ASSERT_EQ(scene->textures.size(), 1U);
  EXPECT_NEAR(scene->textures[0].Sample(0, 0, 1)[0], LinearFromSrgb(0x40), 1e-3);
}

TEST_F(MakeTorcsSceneTest, CutsHolesAndKeepsPlainColours) {
  const auto scene =
      MakeTorcsScene(Model(TriangleObject("T", "tree.rgb", true) + TriangleObject("P", "", true) +
                               TriangleObject("G", "grass.rgb", true),
                           3),
                     options_,
                     "a.ac");
  ASSERT_TRUE(scene);
  ASSERT_EQ(scene->materials.size(), 3U);
  EXPECT_EQ(scene->materials[0].alpha_cutoff, 0.5F);
  EXPECT_GT(scene->materials[0].translucency, 0.0F);
  EXPECT_EQ(scene->materials[1].texture, -1);
  EXPECT_NEAR(scene->materials[1].albedo[0], 1.0F, 1e-6);
  EXPECT_NEAR(scene->materials[1].albedo[2], LinearFromSrgb(128), 1e-6);
  EXPECT_EQ(scene->materials[2].alpha_cutoff, 0.0F);
  ASSERT_EQ(scene->meshes.size(), 2U);
  EXPECT_THAT(scene->meshes[0].triangle_materials, ElementsAre(1U, 2U));
  EXPECT_THAT(scene->meshes[1].triangle_materials, ElementsAre(0U));
}

TEST_F(MakeTorcsSceneTest, LetsTheRoadShineWhenWet) {
  options_.is_road = [](const Eigen::Vector3f& p_W) { return p_W.z() < 1.0F; };
  const std::string wall =
      "OBJECT poly\nnumvert 3\n0 0 0\n1 0 0\n0 1 0\nnumsurf 1\nSURF 0x00\nmat 0\nrefs 3\n0 0 0\n"
      "1 0 0\n2 0 0\nkids 0\n";
  const auto scene = MakeTorcsScene(
      Model(TriangleObject("A", "", true) + TriangleObject("B", "grass.rgb", true) +
                "OBJECT group\nloc 0 5 0\nkids 1\n" + TriangleObject("C", "", true) + wall,
            4),
      options_,
      "a.ac");
  ASSERT_TRUE(scene) << scene.error().message;
  ASSERT_EQ(scene->materials.size(), 4U);
  const auto& [road, grass, bridge, upright] =
      std::tie(scene->materials[0], scene->materials[1], scene->materials[2], scene->materials[3]);
  EXPECT_GT(road.wet_reflectivity, 0.0F);
  EXPECT_GT(road.wet_darkening, 0.0F);
  EXPECT_EQ(grass.wet_reflectivity, 0.0F);
  EXPECT_GT(grass.wet_darkening, 0.0F);
  EXPECT_EQ(bridge.wet_reflectivity, 0.0F);
  EXPECT_GT(bridge.wet_darkening, 0.0F);
  EXPECT_EQ(upright.wet_darkening, 0.0F);
}

TEST_F(MakeTorcsSceneTest, MovesFrontAndBackApart) {
  const auto scene = MakeTorcsScene(
      Model(TriangleObject("F", "grass.rgb", true) + TriangleObject("B", "", false), 2),
      options_,
      "a.ac");
  ASSERT_TRUE(scene);
  const Mesh& mesh = scene->meshes[0];
  ASSERT_EQ(mesh.triangles.size(), 2U);
  EXPECT_GT(mesh.positions[0].z(), 0.004F);
  EXPECT_LT(mesh.positions[3].z(), -0.004F);
}

TEST_F(MakeTorcsSceneTest, SaysWhoMissesWhichTextureWhere) {
  const auto scene =
      MakeTorcsScene(Model(TriangleObject("WALL7", "bricks.png", true), 1), options_, "a.ac");
  ASSERT_FALSE(scene);
  EXPECT_EQ(scene.error().kind, ErrorKind::kInvalidInput);
  EXPECT_EQ(scene.error().message,
            "a.ac: line 5: object 'WALL7': texture 'bricks.png' is in none of the folders " +
                folder_.path() + "/a, " + folder_.path() + "/b");
}

TEST_F(MakeTorcsSceneTest, SaysWhichTextureIsDamaged) {
  const std::string path = folder_.Write("a/bricks.png", "\x89PNG damaged");
  const auto scene =
      MakeTorcsScene(Model(TriangleObject("WALL7", "bricks.png", true), 1), options_, "a.ac");
  ASSERT_FALSE(scene);
  EXPECT_THAT(scene.error().message,
              HasSubstr("a.ac: line 5: object 'WALL7': " + path + ": PNG image: "));
}

TEST_F(MakeTorcsSceneTest, LooksForTexturesInItsFoldersOnly) {
  folder_.Write("secret.rgb", TorcsTestTrack::OnePixel('\x40', '\xff'));
  const auto scene =
      MakeTorcsScene(Model(TriangleObject("T", "../secret.rgb", true), 1), options_, "a.ac");
  ASSERT_FALSE(scene);
  EXPECT_THAT(scene.error().message, HasSubstr("texture '../secret.rgb' is in none"));
}

TEST(TrianglesInWorld, AreSeenFromAboveWhereStripsAre) {
  const auto model = ParseAc3d(TorcsTestTrack::Mesh(), "a.acc");
  ASSERT_TRUE(model) << model.error().message;
  const auto triangles = TrianglesInWorld(*model);
  // Two for each step of the road, and two for each of three quads.
  ASSERT_EQ(triangles.size(), 2U * 82U + 6U);
  for (std::size_t i = 0; i < triangles.size() - 2; ++i) {
    const auto& [a, b, c] = triangles[i];
    EXPECT_GT((b - a).cross(c - a).z(), 0.0F) << i;
  }
}

}  // namespace
}  // namespace relocd
