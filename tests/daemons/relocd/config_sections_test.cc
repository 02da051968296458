#include "relocd/config_sections.h"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace relocd {
namespace {

/// Who starts again when `after` comes for the default config.
std::vector<std::string> Concerned(const Config& after) {
  const ConfigSections old_sections{Config()};
  const ConfigSections new_sections(after);
  std::vector<std::string> concerned;
  for (const char* name : {"recorderd", "smootherd", "inferenced", "odometryd", "camerad_front"}) {
    if (old_sections.ReadBy(name) != new_sections.ReadBy(name)) concerned.emplace_back(name);
  }
  return concerned;
}

TEST(ConfigSectionsTest, NobodyIsConcernedByTheSameConfig) {
  EXPECT_THAT(Concerned(Config()), testing::IsEmpty());
}

TEST(ConfigSectionsTest, TheRecordersSectionConcernsTheRecorder) {
  Config config;
  config.recorder.segment_mb += 1;
  EXPECT_THAT(Concerned(config), testing::ElementsAre("recorderd"));
}

TEST(ConfigSectionsTest, TheSmoothersSectionConcernsTheSmoother) {
  Config config;
  config.localization.state_period_s += 1.0;
  EXPECT_THAT(Concerned(config), testing::ElementsAre("smootherd"));
}

TEST(ConfigSectionsTest, ACameraConcernsItsOwnCameradAndWhoNeedsItsGeometry) {
  Config config;
  config.cameras["front"].X_BC_translation_m[0] += 0.1;
  EXPECT_THAT(Concerned(config), testing::ElementsAre("smootherd", "inferenced", "camerad_front"));
  EXPECT_THAT(ConfigSections(config).CameraNames(), testing::ElementsAre("front"));
}

TEST(ConfigSectionsTest, ANewCameraConcernsNoOtherCamera) {
  Config config;
  config.cameras["rear"] = {};
  EXPECT_THAT(Concerned(config), testing::ElementsAre("smootherd", "inferenced"));
}

TEST(ConfigSectionsTest, TheNetworksConcernEverybody) {
  Config config;
  config.bus.control_url = "memq://";
  EXPECT_EQ(Concerned(config).size(), 5U);
}

TEST(ConfigSectionsTest, TheSupervisorsSectionConcernsItselfOnly) {
  Config config;
  config.supervisor.backoff_max_s = 9.0;
  EXPECT_THAT(Concerned(config), testing::IsEmpty());
}

TEST(ConfigSectionsTest, OtherProgramsReadNothing) {
  EXPECT_EQ(ConfigSections{Config()}.ReadBy("joystick"), "");
}

}  // namespace
}  // namespace relocd
