#include "simulation/ac3d.h"

#include <algorithm>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/eigen_matchers.h"
#include "support/mutate_bytes.h"
#include "support/random.h"
#include "support/temporary_folder.h"

namespace relocd {
namespace {

using ::testing::HasSubstr;
using ::testing::SizeIs;
using ::testing::StartsWith;

constexpr const char* kMaterial =
    "MATERIAL \"wall\" rgb 0.5 0.25 1 amb 1 1 1 emis 0 0 0.5 spec 0 0 0 shi 10 trans 0.25\n";

/// A house as AC3D writes it: nested objects, a place, a quad and a line.
std::string HouseFile() {
  return std::string("AC3Db\n") + kMaterial +
         "OBJECT world\n"
         "kids 1\n"
         "OBJECT group\n"
         "name \"a house\"\n"
         "data 9\n"
         "two\nlines\n"
         "loc 10 20 30\n"
         "kids 1\n"
         "OBJECT poly\n"
         "name \"front\"\n"
         "rot 0 1 0  -1 0 0  0 0 1\n"
         "texture \"bricks.png\"\n"
         "texrep 2 3\n"
         "texoff 0.5 0.25\n"
         "crease 30\n"
         "numvert 4\n"
         "0 0 0\n"
         "1 0 0\n"
         "1 1 0\n"
         "0 1 0.5\n"
         "numsurf 2\n"
         "SURF 0x30\n"
         "mat 0\n"
         "refs 4\n"
         "0 0 0\n"
         "1 1 0\n"
         "2 1 1\n"
         "3 0 1\n"
         "SURF 0x02\n"
         "mat 0\n"
         "refs 2\n"
         "0 0 0\n"
         "2 0 0\n"
         "kids 0\n";
}

/// A piece of road as TORCS writes it: normals, layers, a strip, and a child too few.
std::string RoadFile() {
  return std::string("AC3Db\r\n") + kMaterial +
         "OBJECT world\n"
         "kids 3\n"
         "OBJECT poly\n"
         "name \"TKMN1\"\n"
         "texture \"asphalt.rgb\" base\n"
         "texture \"shadow2.rgb\" tiled\n"
         "texture \"raceline.rgb\" skids\n"
         "texture empty_texture_no_mapping shad\n"
         "numvert 4\n"
         "0 0 0 0 1 0\n"
         "0 0 -5 0 1 0\n"
         "10 0 0 0 1 0\n"
         "10 0 -5 0 1 0\n"
         "numsurf 1\n"
         "SURF 0x14\n"
         "mat 0\n"
         "refs 4\n"
         "0 0 0 0.5 0.5 0.25 0.25 \n"
         "2 1 0 0.5 0.5 0.25 0.25 \n"
         "1 0 1 0.5 0.5 0.25 0.25 \n"
         "3 1 1 0.5 0.5 0.25 0.25 \n"
         "kids 0\n";
}

std::string ParseError(const std::string& text) {
  const auto model = ParseAc3d(text, "a.ac");
  return model ? "" : model.error().message;
}

/// The house's file with one line replaced.
std::string ErrorWith(const std::string& line, const std::string& replacement) {
  std::string text = HouseFile();
  const auto at = text.find(line + "\n");
  EXPECT_NE(at, std::string::npos) << line;
  return ParseError(text.replace(at, line.size(), replacement));
}

TEST(ParseAc3d, ReadsWhatAc3dWrites) {
  const auto model = ParseAc3d(HouseFile(), "a.ac");
  ASSERT_TRUE(model) << model.error().message;
  ASSERT_THAT(model->materials, SizeIs(1));
  EXPECT_EQ(model->materials[0].name, "wall");
  EXPECT_TRUE(model->materials[0].colour.isApprox(Eigen::Array3f(0.5F, 0.25F, 1.0F)));
  EXPECT_TRUE(model->materials[0].emission.isApprox(Eigen::Array3f(0.0F, 0.0F, 0.5F)));
  EXPECT_EQ(model->materials[0].transparency, 0.25F);
  ASSERT_THAT(model->objects, SizeIs(3));
  EXPECT_EQ(model->objects[1].name, "a house");
  EXPECT_EQ(model->objects[1].parent, 0);
  const Ac3dObject& front = model->objects[2];
  EXPECT_EQ(front.name, "front");
  EXPECT_EQ(front.parent, 1);
  EXPECT_EQ(front.line, 12);
  EXPECT_EQ(front.texture, "bricks.png");
  EXPECT_EQ(front.texture_repeat, Eigen::Vector2f(2, 3));
  EXPECT_EQ(front.texture_offset, Eigen::Vector2f(0.5F, 0.25F));
  ASSERT_THAT(front.vertices, SizeIs(4));
  EXPECT_EQ(front.vertices[3], Eigen::Vector3f(0, 1, 0.5F));
  EXPECT_THAT(front.normals, SizeIs(0));
  ASSERT_THAT(front.surfaces, SizeIs(2));
  EXPECT_EQ(front.surfaces[0].kind, Ac3dSurface::Kind::kPolygon);
  EXPECT_TRUE(front.surfaces[0].is_smooth);
  EXPECT_TRUE(front.surfaces[0].is_two_sided);
  ASSERT_THAT(front.surfaces[0].corners, SizeIs(4));
  EXPECT_EQ(front.surfaces[0].corners[2].vertex, 2U);
  EXPECT_EQ(front.surfaces[0].corners[3].uv, Eigen::Vector2f(0, 1));
  EXPECT_EQ(front.surfaces[1].kind, Ac3dSurface::Kind::kLine);
  EXPECT_FALSE(front.surfaces[1].is_smooth);
}

TEST(ParseAc3d, PlacesObjectsInTheirParents) {
  const auto model = ParseAc3d(HouseFile(), "a.ac");
  ASSERT_TRUE(model);
  // The rotation takes x to y; then the house is moved.
  const Eigen::Vector3f corner = model->PlaceOf(2) * Eigen::Vector3f(1, 0, 0);
  EXPECT_TRUE(corner.isApprox(Eigen::Vector3f(10, 21, 30))) << corner.transpose();
}

TEST(ParseAc3d, ReadsWhatTorcsWrites) {
  const auto model = ParseAc3d(RoadFile(), "a.acc");
  ASSERT_TRUE(model) << model.error().message;
  ASSERT_THAT(model->objects, SizeIs(2));
  const Ac3dObject& road = model->objects[1];
  EXPECT_EQ(road.texture, "asphalt.rgb");
  ASSERT_THAT(road.normals, SizeIs(4));
  EXPECT_EQ(road.normals[2], Eigen::Vector3f(0, 1, 0));
  ASSERT_THAT(road.surfaces, SizeIs(1));
  EXPECT_EQ(road.surfaces[0].kind, Ac3dSurface::Kind::kTriangleStrip);
  EXPECT_FALSE(road.surfaces[0].is_two_sided);
  EXPECT_EQ(road.surfaces[0].corners[1].uv, Eigen::Vector2f(1, 0));
}

TEST(ParseAc3d, TakesNoTextureForItsName) {
  std::string text = RoadFile();
  text.replace(text.find("\"asphalt.rgb\""), 13, "\"(null)\"");
  const auto model = ParseAc3d(text, "a.acc");
  ASSERT_TRUE(model);
  EXPECT_EQ(model->objects[1].texture, "");
}

TEST(ParseAc3d, NamesLineValueAndWhatIsAllowed) {
  EXPECT_EQ(ErrorWith("numvert 4", "numvert 99999999"),
            "a.ac: line 19: numvert is 99999999, must be in [0, 4000000]");
  EXPECT_EQ(ErrorWith("numvert 4", "numvert -1"),
            "a.ac: line 19: numvert is -1, must be in [0, 4000000]");
  EXPECT_EQ(ErrorWith("numvert 4", "numvert"), "a.ac: line 19: numvert is missing");
  EXPECT_EQ(ErrorWith("1 1 0", "1 one 0"),
            "a.ac: line 22: vertex is 'one', must be a number in [-1000000, 1000000]");
  EXPECT_EQ(ErrorWith("1 1 0", "1 nan 0"),
            "a.ac: line 22: vertex is 'nan', must be a number in [-1000000, 1000000]");
  EXPECT_EQ(ErrorWith("1 1 0", "1 1 0 1"),
            "a.ac: line 22: vertex has 4 numbers, must have 3, or 6 with its normal");
  EXPECT_EQ(ErrorWith("0 1 0.5", "0 1 0 0 0 1"),
            "a.ac: line 23: 1 of 4 vertices have a normal, must be all or none");
  EXPECT_EQ(ErrorWith("SURF 0x30", "SURF 0x33"),
            "a.ac: line 25: SURF is 0x33, its last digit must be 0 (polygon), 1 (closed line), 2 "
            "(line) or 4 (triangle strip)");
  EXPECT_EQ(ErrorWith("SURF 0x30", "SURF x"),
            "a.ac: line 25: SURF is 'x', must be a number such as 0x30");
  EXPECT_EQ(ErrorWith("mat 0", "mat 1"), "a.ac: line 26: mat is 1, must be in [0, 0]");
  EXPECT_EQ(ErrorWith("2 1 1", "4 1 1"), "a.ac: line 30: vertex is 4, must be in [0, 3]");
  EXPECT_EQ(ErrorWith("2 1 1", "2 1"),
            "a.ac: line 30: corner has 1 texture coordinates, must have two for each layer");
  EXPECT_EQ(ErrorWith("2 1 1", "2 1 1 1 1 1 1 1 1 1"),
            "a.ac: line 30: corner has more than 8 numbers");
  EXPECT_EQ(ErrorWith("data 9", "data 5000"), "a.ac: line 7: data is 5000, must be at most 273");
  EXPECT_THAT(ErrorWith("crease 30", "creese 30"),
              StartsWith("a.ac: line 18: is 'creese', must be one of name, data, texture"));
  EXPECT_EQ(ErrorWith("OBJECT group", "OBJEKT group"), "a.ac: line 5: is 'OBJEKT', must be OBJECT");
  EXPECT_EQ(ErrorWith("kids 0", "kids 1"), "a.ac: line 37: the file ends, must go on with OBJECT");
  EXPECT_EQ(ErrorWith("AC3Db", "ply"), "a.ac: line 1: is 'ply', must be AC3D and a version");
  EXPECT_EQ(ParseError(""), "a.ac: line 0: the file ends, must go on with AC3D and a version");
  EXPECT_EQ(ParseError("AC3Db\n"), "a.ac: line 1: the file ends, must go on with OBJECT");
  EXPECT_EQ(ParseError("AC3Db\nMATERIAL \"\" rgb 1 1\n"), "a.ac: line 2: rgb is missing");
  EXPECT_EQ(ParseError("AC3Db\nMATERIAL \"\" rgb 1 1 1\n"),
            "a.ac: line 2: MATERIAL has no trans at its end");
}

TEST(ParseAc3d, RefusesObjectsNestedTooDeep) {
  std::string text = "AC3Db\n";
  for (int i = 0; i < 100'000; ++i) {
    text += "OBJECT group\nkids 1\n";
  }
  EXPECT_THAT(ParseError(text), HasSubstr("objects are nested deeper than 100"));
}

TEST(ParseAc3d, NamesALineWhereverTheFileIsCutShort) {
  const std::string house = HouseFile();
  for (std::size_t size = 0; size + 1 < house.size(); ++size) {
    EXPECT_THAT(ParseError(house.substr(0, size)), StartsWith("a.ac: line ")) << size;
  }
  // A road may end where its next child would begin.
  const std::string road = RoadFile();
  const std::size_t first_child = road.find("OBJECT poly");
  for (std::size_t size = 0; size + 1 < road.size(); ++size) {
    if (size + 1 == first_child || size == first_child) continue;
    EXPECT_THAT(ParseError(road.substr(0, size)), StartsWith("a.ac: line ")) << size;
  }
}

void ExpectIndicesInRange(const Ac3dModel& model) {
  for (const Ac3dObject& object : model.objects) {
    for (const Ac3dSurface& surface : object.surfaces) {
      EXPECT_LT(surface.material, model.materials.size());
      const bool is_in_range =
          std::all_of(surface.corners.begin(), surface.corners.end(), [&](const auto& corner) {
            return corner.vertex < object.vertices.size();
          });
      EXPECT_TRUE(is_in_range);
    }
  }
}

TEST(ParseAc3d, SurvivesAnyBytes) {
  TestRandom random(1);
  int refused = 0;
  constexpr int kTrials = 20'000;
  for (int trial = 0; trial < kTrials; ++trial) {
    const std::string text = trial % 2 == 0 ? HouseFile() : RoadFile();
    const auto model = ParseAc3d(MutateBytes(text, random), "a.ac");
    if (model) {
      ExpectIndicesInRange(*model);
      continue;
    }
    ++refused;
    EXPECT_THAT(model.error().message, StartsWith("a.ac: line "));
  }
  EXPECT_GT(refused, kTrials / 2);
}

TEST(ReadAc3d, NamesAFileThatIsNotThere) {
  const TemporaryFolder folder;
  const auto model = ReadAc3d(folder.path() + "/none.ac");
  ASSERT_FALSE(model);
  EXPECT_EQ(model.error().kind, ErrorKind::kUnavailable);
  EXPECT_THAT(model.error().message, HasSubstr("none.ac"));
}

}  // namespace
}  // namespace relocd
