#include "supervision/process_spec.h"

#include <cmath>
#include <functional>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace relocd {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

const ProcessTableContext kContext{.cameras = {"front", "rear"},
                                   .program_directory = "/usr/bin",
                                   .arguments = {"--config", "/etc/robot.yaml"}};

TEST(SupervisionConfigTest, IsValidByDefault) {
  const auto valid = SupervisionConfig{}.Validate();
  EXPECT_TRUE(valid) << valid.error().message;
}

struct BadConfig {
  std::string name;
  std::function<void(SupervisionConfig&)> spoil;
  std::string message;
};
class BadSupervisionConfigTest : public testing::TestWithParam<BadConfig> {};

TEST_P(BadSupervisionConfigTest, IsRefusedWithFieldValueAndRule) {
  SupervisionConfig config;
  GetParam().spoil(config);
  const auto valid = config.Validate();
  ASSERT_FALSE(valid);
  EXPECT_EQ(valid.error().kind, ErrorKind::kInvalidInput);
  EXPECT_THAT(valid.error().message, HasSubstr(GetParam().message));
}

INSTANTIATE_TEST_SUITE_P(
    Table,
    BadSupervisionConfigTest,
    testing::Values(BadConfig{"NanDelay",
                              [](auto& c) { c.playback_delay_s = NAN; },
                              "playback_delay_s is nan, must be in [0, 60]"},
                    BadConfig{"BackoffUpsideDown",
                              [](auto& c) { c.backoff_max_s = 0.05; },
                              "backoff_max_s is 0.05, must be in [0.1 (backoff_initial_s), 3600]"},
                    BadConfig{"Watchdog",
                              [](auto& c) { c.odometryd.watchdog_s = 0.01; },
                              "odometryd.watchdog_s is 0.01, must be 0 or in [0.1, 3600]"},
                    BadConfig{"Scheduling",
                              [](auto& c) { c.smootherd.scheduling = "rr"; },
                              "smootherd.scheduling is 'rr', must be other or fifo"},
                    BadConfig{"FifoWithoutPriority",
                              [](auto& c) { c.smootherd.priority = 0; },
                              "smootherd.priority is 0, must be in [1, 99] with scheduling fifo"},
                    BadConfig{"PriorityWithoutFifo",
                              [](auto& c) { c.camerad.priority = 5; },
                              "camerad.priority is 5, must be 0 with scheduling other"},
                    BadConfig{"UnknownDependency",
                              [](auto& c) { c.smootherd.after = {"camerd"}; },
                              "smootherd.after names 'camerd', must be of camerad, inferenced, "},
                    BadConfig{"Circle",
                              [](auto& c) { c.recorderd.after = {"smootherd"}; },
                              "must not be a circle"},
                    BadConfig{"StopTooLong",
                              [](auto& c) { c.camerad.stop_timeout_s = 6.0; },
                              "add up to 13, must be at most 10"},
                    BadConfig{"NameOfADaemon",
                              [](auto& c) { c.others["odometryd"].command = {"x"}; },
                              "others.odometryd: is a daemon's name"},
                    BadConfig{"NameOfACamera",
                              [](auto& c) { c.others["camerad_front"].command = {"x"}; },
                              "others.camerad_front: is a daemon's name"},
                    BadConfig{"NameWithABlank",
                              [](auto& c) { c.others["a b"].command = {"x"}; },
                              "name is 'a b', must be of letters"},
                    BadConfig{"NoCommand",
                              [](auto& c) { c.others["joystick"] = {}; },
                              "others.joystick.command is empty, must name a program"}),
    [](const auto& instance) { return instance.param.name; });

TEST(ProcessTableTest, HasOneCameradForEachCamera) {
  const auto table = MakeProcessTable(SupervisionConfig{}, kContext);
  std::vector<std::string> names;
  names.reserve(table.size());
  for (const ProcessSpec& spec : table)
    names.push_back(spec.name);
  EXPECT_THAT(
      names,
      ElementsAre(
          "recorderd", "smootherd", "inferenced", "odometryd", "camerad_front", "camerad_rear"));
  EXPECT_THAT(table[5].config.command,
              ElementsAre("/usr/bin/camerad", "--config", "/etc/robot.yaml", "--camera", "rear"));
}

TEST(ProcessTableTest, PutsEveryCameraForCamerad) {
  SupervisionConfig config;
  config.others["panel"] = {.command = {"/opt/panel", "-x"}, .after = {"camerad", "recorderd"}};
  const auto table = MakeProcessTable(config, kContext);
  EXPECT_THAT(table.back().config.command, ElementsAre("/opt/panel", "-x"));
  EXPECT_THAT(table.back().config.after, ElementsAre("recorderd", "camerad_front", "camerad_rear"));
}

TEST(ProcessTableTest, LeavesOutWhoIsNotEnabledAndNobodyWaitsForThem) {
  SupervisionConfig config;
  config.recorderd.enabled = false;
  const auto table = MakeProcessTable(config, kContext);
  ASSERT_EQ(table.size(), 5U);
  EXPECT_EQ(table[0].name, "smootherd");
  EXPECT_THAT(table[0].config.after, ElementsAre());
  EXPECT_THAT(table[2].config.after, ElementsAre("smootherd"));
}

}  // namespace
}  // namespace relocd
