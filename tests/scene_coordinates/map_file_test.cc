#include "scene_coordinates/map_file.h"

#include <cstring>
#include <functional>
#include <random>
#include <string>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/sha256.h"
#include "scene_coordinates/test_map.h"
#include "support/temporary_folder.h"

namespace relocd {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::StartsWith;

constexpr std::size_t kVersionAt = 8;
constexpr std::size_t kSizeAt = 16;
constexpr std::size_t kHashAt = 24;
constexpr std::size_t kHeaderSize = 88;

/// Size and hash as if the content had always been so: what only the field checks can find.
std::string WithHeaderRepaired(std::string bytes) {
  const std::string content = bytes.substr(kHeaderSize);
  const std::uint64_t size = content.size();
  std::memcpy(bytes.data() + kSizeAt, &size, sizeof(size));
  const std::string hash = Sha256Hex(content);
  bytes.replace(kHashAt, hash.size(), hash);
  return bytes;
}

std::string ErrorOf(const std::string& bytes) {
  const auto map = ParseMap(bytes, "x.relocmap");
  if (map) return "no error";
  EXPECT_EQ(map.error().kind, ErrorKind::kInvalidInput);
  return map.error().message;
}

TEST(MapFileTest, GivesBackWhatWasWritten) {
  const SceneMap map = MakeTestMap();
  const auto read = ParseMap(SerializeMap(map), "x.relocmap");
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read->camera, map.camera);
  EXPECT_EQ(read->R_WD.coeffs(), map.R_WD.coeffs());
  EXPECT_EQ(read->whitening.basis, map.whitening.basis);
  EXPECT_EQ(read->training.dataset, "street");
  EXPECT_EQ(read->training.median_error_m, 0.25);
  ASSERT_EQ(read->regions.size(), 2U);
  EXPECT_EQ(read->regions[1].name, "second");
  EXPECT_EQ(read->regions[1].calibration.covariance_factor, 4.0);
  EXPECT_EQ(read->regions[1].training_poses.size(), 2U);
  EXPECT_EQ(read->regions[1].head.layers[2].weights, map.regions[1].head.layers[2].weights);
  EXPECT_EQ(read->id.size(), 64U);
  // Everything else, too.
  EXPECT_EQ(SerializeMap(*read), SerializeMap(map));
}

TEST(MapFileTest, MakesProgressWithTheHashAndWithEachArray) {
  const SceneMap map = MakeTestMap();
  std::size_t arrays = 2;  // of the whitening
  for (const MapRegion& region : map.regions)
    arrays += 2 * region.head.layers.size();
  std::size_t steps = 0;
  ASSERT_TRUE(ParseMap(SerializeMap(map), "x.relocmap", [&steps] { ++steps; }));
  EXPECT_EQ(steps, 1 + arrays);
}

TEST(MapFileTest, FilesGoThereAndBack) {
  const TemporaryFolder folder;
  const std::string path = folder.path() + "/a.relocmap";
  ASSERT_TRUE(WriteMap(MakeTestMap(), path));
  EXPECT_TRUE(ReadMap(path));
}

TEST(MapFileTest, SaysHowToMakeAMissingMap) {
  const auto map = ReadMap("/nowhere/a.relocmap");
  ASSERT_FALSE(map);
  EXPECT_EQ(map.error().kind, ErrorKind::kInvalidInput);
  EXPECT_THAT(map.error().message,
              AllOf(StartsWith("/nowhere/a.relocmap: "), HasSubstr("reloc map train")));
}

TEST(MapFileTest, RefusesWhatIsNoMap) {
  EXPECT_EQ(ErrorOf("\x7f"
                    "ELF\x02\x01\x01 and so on"),
            "x.relocmap: begins with '.ELF... ', must begin with 'RELOCMAP': it is no map");
  EXPECT_THAT(ErrorOf(""), HasSubstr("it is no map"));
}

TEST(MapFileTest, RefusesATruncatedMap) {
  const std::string bytes = SerializeMap(MakeTestMap());
  EXPECT_EQ(ErrorOf(bytes.substr(0, 50)),
            "x.relocmap: is 50 bytes long, the header alone must be 88: it is truncated");
  EXPECT_EQ(ErrorOf(bytes.substr(0, 1000)),
            fmt::format("x.relocmap: content is 912 bytes long, must be {}: it is truncated",
                        bytes.size() - kHeaderSize));
}

TEST(MapFileTest, RefusesAnotherFormatVersion) {
  std::string bytes = SerializeMap(MakeTestMap());
  bytes[kVersionAt] = 9;
  EXPECT_THAT(ErrorOf(bytes), StartsWith("x.relocmap: format version is 9, must be 2: "));
}

TEST(MapFileTest, RefusesAContentThatDoesNotMatchItsHash) {
  std::string bytes = SerializeMap(MakeTestMap());
  bytes[bytes.size() / 2] = static_cast<char>(bytes[bytes.size() / 2] ^ 1);
  EXPECT_THAT(
      ErrorOf(bytes),
      AllOf(StartsWith("x.relocmap: sha256 of the content is "), HasSubstr("it is damaged")));
}

struct Change {
  const char* name;
  std::function<void(SceneMap&)> apply;
  const char* message;
};

class MapFieldTest : public testing::TestWithParam<Change> {};

TEST_P(MapFieldTest, IsRefusedByName) {
  SceneMap map = MakeTestMap();
  GetParam().apply(map);
  EXPECT_THAT(ErrorOf(SerializeMap(map)), HasSubstr(GetParam().message));
}

INSTANTIATE_TEST_SUITE_P(
    Fields,
    MapFieldTest,
    testing::Values(
        Change{
            "Focal", [](SceneMap& map) { map.camera.fx = -1.0; }, "camera.fx is -1, must be in ["},
        Change{"Nan",
               [](SceneMap& map) { map.camera.cy = std::nan(""); },
               "camera.cy is nan, must be in ["},
        Change{"Octaves",
               [](SceneMap& map) { map.features.octaves = 40; },
               "features.octaves is 40, must be in [1, 5]"},
        Change{"OctavesAndWhitening",
               [](SceneMap& map) { map.features.octaves = 3; },
               "whitening.inputs is 272, must be 340"},
        Change{"ImageSize",
               [](SceneMap& map) { map.features.image_width = 320; },
               "features.image_width is 320, must be 160 as camera.width"},
        Change{"Rotation",
               [](SceneMap& map) { map.R_WD.coeffs() *= 0.5; },
               "R_WD has norm 0.5, must be 1"},
        Change{"Factor",
               [](SceneMap& map) { map.regions[0].calibration.covariance_factor = 0.5; },
               "region.covariance_factor is 0.5, must be in [1, 1000000000]"},
        Change{"NoRegion",
               [](SceneMap& map) { map.regions.clear(); },
               "regions is 0, must be in [1, 1024]"},
        Change{"LongName",
               [](SceneMap& map) { map.regions[1].name.assign(1000, 'a'); },
               "region.name is 1000, must be in [0, 256]"}),
    [](const auto& instance) { return instance.param.name; });

TEST(MapFileTest, MutatedBytesNeverCrash) {
  const std::string bytes = SerializeMap(MakeTestMap());
  std::mt19937 engine(1);
  int read = 0;
  for (int trial = 0; trial < 300; ++trial) {
    std::string mutated = bytes;
    const int changes = 1 + static_cast<int>(engine() % 4);
    for (int change = 0; change < changes; ++change) {
      // Half of them where lengths and shapes are.
      const std::size_t span = trial % 2 == 0 ? 400 : mutated.size() - kHeaderSize;
      mutated[kHeaderSize + engine() % span] = static_cast<char>(engine());
    }
    if (trial % 5 == 0) mutated.resize(kHeaderSize + engine() % (mutated.size() - kHeaderSize));
    if (ParseMap(WithHeaderRepaired(mutated), "x.relocmap")) ++read;
    EXPECT_FALSE(ParseMap(mutated, "x.relocmap"));
  }
  EXPECT_GT(read, 0);  // changed weights are weights
}

TEST(MapFileTest, RefusesBytesAfterTheLastRegion) {
  EXPECT_THAT(ErrorOf(WithHeaderRepaired(SerializeMap(MakeTestMap()) + "more")),
              HasSubstr("4 bytes follow the last region, must be 0"));
}

}  // namespace
}  // namespace relocd
