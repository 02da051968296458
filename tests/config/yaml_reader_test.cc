#include "config/yaml_reader.h"

#include <random>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "config/yaml_writer.h"

namespace relocd {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

struct Wheel {
  double radius_m = 0.1;
  std::string signal = "WHEELS.LEFT";

  template <typename Self, typename Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("radius_m", self.radius_m, "> 0");
    visit("signal", self.signal, "MESSAGE.SIGNAL");
  }
  bool operator==(const Wheel&) const = default;
};

struct Robot {
  bool enabled = true;
  int count = 3;
  std::array<double, 3> offset_m{1.0, 2.0, 3.0};
  std::vector<std::string> words{"a", "b \"quoted\""};
  Wheel wheel;
  std::map<std::string, Wheel> wheels;

  template <typename Self, typename Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("enabled", self.enabled, "true or false");
    visit("count", self.count, "");
    visit("offset_m", self.offset_m, "x y z");
    visit("words", self.words, "");
    visit("wheel", self.wheel, "One wheel.");
    visit("wheels", self.wheels, "By name.");
  }
  bool operator==(const Robot&) const = default;
};

Result<Robot> Read(const std::string& text, const std::vector<std::string>& overrides = {}) {
  Robot robot;
  auto ok = YamlReader::ReadText(text, "robot.yaml", overrides, robot);
  if (!ok) return std::move(ok).error();
  return robot;
}

std::string ErrorOf(const std::string& text) {
  const auto robot = Read(text);
  EXPECT_FALSE(robot) << text;
  return robot ? "" : robot.error().message;
}

TEST(YamlReaderTest, AnEmptyFileGivesTheDefaults) {
  EXPECT_EQ(Read("").value(), Robot());
  EXPECT_EQ(Read("# nothing\n").value(), Robot());
  EXPECT_EQ(Read("wheel:\n").value(), Robot());
}

TEST(YamlReaderTest, ReadsEveryKindOfField) {
  const auto robot = Read(
      "enabled: false\ncount: -7\noffset_m: [0.5, -1e3, 0]\nwords: [x]\n"
      "wheel: {radius_m: 0.25}\nwheels:\n  left: {signal: A.B}\n  right:\n    radius_m: 2\n");
  ASSERT_TRUE(robot) << robot.error().message;
  EXPECT_FALSE(robot->enabled);
  EXPECT_EQ(robot->count, -7);
  EXPECT_THAT(robot->offset_m, ElementsAre(0.5, -1000.0, 0.0));
  EXPECT_THAT(robot->words, ElementsAre("x"));
  EXPECT_EQ(robot->wheel.radius_m, 0.25);
  EXPECT_EQ(robot->wheel.signal, "WHEELS.LEFT");
  EXPECT_EQ(robot->wheels.at("left").signal, "A.B");
  EXPECT_EQ(robot->wheels.at("right").radius_m, 2.0);
}

TEST(YamlReaderTest, ReadsBackWhatTheWriterWrites) {
  Robot robot;
  robot.count = 12;
  robot.offset_m = {0.1, 1.0 / 3.0, -5e-300};
  robot.words = {"back\\slash", "line\nbreak", ""};
  robot.wheels["left"].radius_m = 0.3;
  const std::string text = YamlWriter::Write(robot);
  const auto read = Read(text);
  ASSERT_TRUE(read) << read.error().message << "\n" << text;
  EXPECT_EQ(*read, robot);
}

TEST(YamlReaderTest, NamesTheNearestKeyOfAnUnknownOne) {
  EXPECT_EQ(ErrorOf("count: 1\nwheel:\n  radius: 0.1\n"),
            "robot.yaml: line 3: unknown key 'wheel.radius', did you mean 'radius_m'? expected one "
            "of radius_m, signal");
}

TEST(YamlReaderTest, NamesValueAndWhatIsAllowed) {
  EXPECT_EQ(ErrorOf("wheel: {radius_m: wide}"),
            "robot.yaml: line 1: wheel.radius_m is 'wide', must be a number");
  EXPECT_EQ(ErrorOf("\ncount: 1.5"), "robot.yaml: line 2: count is '1.5', must be an integer");
  EXPECT_EQ(ErrorOf("enabled: yes"), "robot.yaml: line 1: enabled is 'yes', must be true or false");
  EXPECT_EQ(ErrorOf("offset_m: [1, 2]"),
            "robot.yaml: line 1: offset_m is a list of 2, must be a list of 3 numbers");
  EXPECT_EQ(ErrorOf("count: 99999999999"),
            "robot.yaml: line 1: count is '99999999999', must be an integer of 32 bits");
  EXPECT_EQ(ErrorOf("wheel: 3"), "robot.yaml: line 1: wheel is '3', must be a section with keys");
}

TEST(YamlReaderTest, RefusesAKeyThatIsGivenTwice) {
  EXPECT_EQ(ErrorOf("count: 1\ncount: 2\n"), "robot.yaml: line 2: key 'count' is given twice");
  EXPECT_THAT(ErrorOf("wheels:\n  a: {}\n  a: {}\n"), HasSubstr("key 'wheels.a' is given twice"));
}

TEST(YamlReaderTest, NamesTheLineOfBrokenYaml) {
  EXPECT_THAT(ErrorOf("count: 1\nwheel: {radius_m: 2\n"), HasSubstr("robot.yaml: line "));
  EXPECT_THAT(ErrorOf("- a\n- b\n"), HasSubstr("must have sections with keys"));
}

TEST(YamlReaderTest, OverridesGoOverTheFile) {
  const auto robot =
      Read("wheel: {radius_m: 0.2}\n", {"wheel.radius_m=0.4", "wheels.left.signal=X.Y"});
  ASSERT_TRUE(robot) << robot.error().message;
  EXPECT_EQ(robot->wheel.radius_m, 0.4);
  EXPECT_EQ(robot->wheels.at("left").signal, "X.Y");
  EXPECT_EQ(Read("", {"wheel.signal="}).value().wheel.signal, "");
  EXPECT_THAT(Read("", {"wheel"}).error().message, HasSubstr("--set wheel"));
  EXPECT_THAT(Read("", {"count.x=1"}).has_value(), false);
}

TEST(YamlReaderTest, SurvivesHostileText) {
  const std::string text = YamlWriter::Write(Robot());
  std::mt19937 random(1);
  constexpr std::string_view kLetters = ":-[]{}\n\t \"'&*!|>%@0a#,?~";
  for (int trial = 0; trial < 2000; ++trial) {
    std::string mutant = text;
    for (int i = 0; i < 4; ++i) {
      mutant[std::uniform_int_distribution<std::size_t>(0, mutant.size() - 1)(random)] =
          kLetters[random() % kLetters.size()];
    }
    static_cast<void>(Read(mutant).has_value());
  }
  EXPECT_FALSE(Read(std::string(100'000, '[')));
  EXPECT_FALSE(Read(std::string(2'000'000, ' ')));
}

}  // namespace
}  // namespace relocd
