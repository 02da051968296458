#include <unistd.h>

#include <array>
#include <chrono>
#include <string>

#include <gtest/gtest.h>

#include "relocalization/map_localizer.h"
#include "relocalization/one_image_map.h"
#include "runtime/start_extension.h"
#include "supervision/notify_server.h"
#include "supervision/restart_policy.h"
#include "support/temporary_folder.h"

namespace relocd {
namespace {

using namespace std::chrono_literals;

/// What inferenced does at its start and what the supervisor makes of it, without time passing.
class SlowStartTest : public testing::Test {
 protected:
  SlowStartTest() {
    const CameraIntrinsics camera{
        .fx = 260.0, .fy = 262.0, .cx = 158.0, .cy = 121.0, .width = 320, .height = 240};
    SceneMap map = MakeOneImageMap(MakeTexturedImage(320, 240, 1), camera, Pose3());
    map.regions.front().training_poses.resize(1);
    map.regions.resize(4, map.regions.front());
    config_.map_path = folder_.path() + "/site.relocmap";
    EXPECT_TRUE(WriteMap(map, config_.map_path));
    child_ = Advance(child_, {.kind = RestartEventKind::kDependenciesMet}, now_, {}).next;
  }

  /// What the supervisor does at its next look.
  RestartAction LookAtTheChild() {
    while (const auto notification = notify_.Receive(::getpid())) {
      EXPECT_TRUE(notification->extend_timeout);
      child_ = Advance(child_,
                       {.kind = RestartEventKind::kExtend,
                        .extension = notification->extend_timeout.value_or(0s)},
                       now_,
                       {})
                   .next;
    }
    return Advance(child_, {.kind = RestartEventKind::kTick}, now_, {}).action;
  }

  TemporaryFolder folder_;
  InferenceConfig config_;
  NotifyServer notify_ = NotifyServer::Open().value();
  std::string variable_ = "NOTIFY_SOCKET=" + notify_.address();
  std::array<const char*, 2> environment_{variable_.c_str(), nullptr};
  ServiceManager manager_ = ServiceManager::FromEnvironment(environment_.data());
  StartExtension extension_{manager_, RestartLimits{}.start_timeout};
  MonotonicTime now_{1000s};
  RestartState child_;
};

TEST_F(SlowStartTest, HasTimeForAsLongAsItMakesProgress) {
  const MonotonicTime start = now_;
  const auto localizer = MapLocalizer::Load(config_, [this] {
    now_ += 8s;
    extension_.Step(now_);
    EXPECT_EQ(LookAtTheChild(), RestartAction::kNone);
  });
  ASSERT_TRUE(localizer) << localizer.error().message;
  EXPECT_GT(now_ - start, 1min);

  now_ += 10s;
  EXPECT_EQ(LookAtTheChild(), RestartAction::kAbort) << "nothing was done in these";
}

TEST_F(SlowStartTest, IsEndedWhereAStepDoesNot) {
  bool is_aborted = false;
  ASSERT_TRUE(MapLocalizer::Load(config_, [&] {
    now_ += 11s;
    is_aborted = is_aborted || LookAtTheChild() == RestartAction::kAbort;
    extension_.Step(now_);
  }));
  EXPECT_TRUE(is_aborted);
}

}  // namespace
}  // namespace relocd
