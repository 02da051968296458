#include "config/config.h"

#include <filesystem>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/file.h"
#include "support/temporary_folder.h"

namespace relocd {
namespace {

using testing::HasSubstr;

class ConfigTest : public testing::Test {
 protected:
  Result<Config> Load(const std::string& text, const std::vector<std::string>& overrides = {}) {
    EXPECT_TRUE(WriteFileAtomically(path_, text));
    return LoadConfig(path_, overrides);
  }

  TemporaryFolder temporary_;
  std::string path_ = temporary_.path() + "/robot.yaml";
};

TEST_F(ConfigTest, TheDefaultsAreValid) {
  const auto ok = Config().Validate();
  EXPECT_TRUE(ok) << ok.error().message;
}

TEST_F(ConfigTest, TheShippedFileHasEveryKeyAtItsDefault) {
  const auto shipped = ReadFile(RELOCD_SOURCE_DIR "/config/robot.yaml");
  ASSERT_TRUE(shipped) << shipped.error().message;
  EXPECT_THAT(*shipped, testing::EndsWith(FormatConfig(Config())))
      << "renew it: (sed '/^$/q' config/robot.yaml; reloc check-config --defaults)";
}

TEST_F(ConfigTest, ReadsBackWhatItFormats) {
  const std::string text = FormatConfig(Config());
  const auto config = Load(text);
  ASSERT_TRUE(config) << config.error().message;
  EXPECT_EQ(ConfigHash(*config), ConfigHash(Config()));
}

TEST_F(ConfigTest, NamesTheLineOfAValueOutOfRange) {
  const auto config = Load("bus:\n  # comment\nrecorder:\n  flush_s: 0\n");
  ASSERT_FALSE(config);
  EXPECT_EQ(config.error().message, path_ + ": line 4: recorder.flush_s is 0, must be in (0, 60]");
  EXPECT_EQ(config.error().kind, ErrorKind::kInvalidInput);
}

TEST_F(ConfigTest, NamesAnOverrideOutOfRange) {
  const auto config = Load("", {"recorder.flush_s=0"});
  ASSERT_FALSE(config);
  EXPECT_EQ(config.error().message, "--set: recorder.flush_s is 0, must be in (0, 60]");
}

TEST_F(ConfigTest, AnOverrideOfAnotherKindIsInNoLineOfTheFile) {
  const auto config = Load("", {"recorder.flush_s=soon"});
  ASSERT_FALSE(config);
  EXPECT_EQ(config.error().message,
            path_ + ": --set: recorder.flush_s is 'soon', must be a number");
}

TEST_F(ConfigTest, WithoutAFileOverridesAreOfTheDefaults) {
  const auto config = LoadConfig("", {"recorder.flush_s=2.5"});
  ASSERT_TRUE(config) << config.error().message;
  EXPECT_EQ(config->recorder.flush_s, 2.5);
  EXPECT_EQ(config->localization.smoother.window_keyframes, SmootherConfig().window_keyframes);
  EXPECT_EQ(LoadConfig("", {"recorder.flush_s=soon"}).error().message,
            "--set: recorder.flush_s is 'soon', must be a number");
}

TEST_F(ConfigTest, RefusesNetworksThatWouldHearEachOther) {
  const auto config = Load("bus:\n  image_url: udpm://239.1.1.1:7667?ttl=0\n");
  ASSERT_FALSE(config);
  EXPECT_THAT(config.error().message, HasSubstr("bus.image_url has port 7667 as control_url has"));
}

TEST_F(ConfigTest, CamerasHaveNames) {
  const auto config = Load("cameras:\n  left: {width: 320}\n  right: {}\n");
  ASSERT_TRUE(config) << config.error().message;
  ASSERT_EQ(config->cameras.size(), 2U);
  EXPECT_EQ(config->cameras.at("left").width, 320);
  EXPECT_EQ(config->cameras.at("right").width, CameraConfig().width);
}

TEST_F(ConfigTest, NamesTheLineOfABadCamera) {
  EXPECT_EQ(Load("cameras:\n  left: {}\n  right:\n    width: 3\n").error().message,
            path_ + ": line 4: cameras.right.width is 3, must be in [16, 8192]");
}

TEST_F(ConfigTest, PathsAreRelativeToTheFile) {
  const auto config = Load("can: {dbc_file: vehicles/rover.dbc}\nrecorder: {directory: /log}\n");
  ASSERT_TRUE(config) << config.error().message;
  EXPECT_EQ(config->can.dbc_file,
            std::filesystem::path(path_).parent_path() / "vehicles/rover.dbc");
  EXPECT_EQ(config->recorder.directory, "/log");
}

TEST_F(ConfigTest, AMissingFileIsNotABadOne) {
  const auto config = LoadConfig("/nonexistent/robot.yaml", {});
  ASSERT_FALSE(config);
  EXPECT_EQ(config.error().kind, ErrorKind::kUnavailable);
}

}  // namespace
}  // namespace relocd
