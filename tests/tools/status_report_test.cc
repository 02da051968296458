#include "status_report.h"

#include <chrono>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "messaging/in_process_bus.h"

namespace relocd {
namespace {

using namespace std::chrono_literals;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr MonotonicTime kNow{1000s};

process_t Process(const std::string& name, int state) {
  process_t process{};
  process.name = name;
  process.state = static_cast<std::int32_t>(state);
  process.pid = 42;
  process.last_exit_code = -1;
  process.uptime_s = 3723.0;
  process.rss_bytes = 12'000'000;
  return process;
}

supervisor_t Table(const std::vector<process_t>& processes) {
  supervisor_t table{};
  table.processes = processes;
  table.n = static_cast<std::int32_t>(processes.size());
  return table;
}

localization_t Pose(Duration before_now, int status = localization_t::OK) {
  localization_t pose{};
  pose.mono_ns = ToNanoseconds(kNow - before_now);
  pose.status = static_cast<std::int32_t>(status);
  pose.x_WB_m = 12.345;
  pose.y_WB_m = -3.0;
  pose.yaw_WB_rad = 1.5707963267948966;
  pose.covariance[0] = 0.04;
  pose.covariance[4] = 0.01;
  pose.covariance[8] = 0.0001;
  return pose;
}

status_t Status(const std::string& daemon, int level, const std::string& message) {
  status_t status{};
  status.daemon = daemon;
  status.level = static_cast<std::int32_t>(level);
  status.message = message;
  return status;
}

/// Everything is as it should be.
StatusReport Well() {
  StatusReport report;
  report.Handle(
      Table({Process("odometryd", process_t::READY), Process("smootherd", process_t::READY)}));
  report.Handle(Status("odometryd", status_t::OK, ""));
  report.Handle(Pose(30ms));
  report.Handle(Pose(20ms));
  report.Handle(Pose(10ms));
  return report;
}

TEST(StatusReportTest, FindsNoProblemWhenAllIsWell) {
  EXPECT_THAT(Well().Problems(kNow), IsEmpty());
}

TEST(StatusReportTest, SaysWhatToDoWhenNothingIsHeard) {
  EXPECT_THAT(StatusReport().Problems(kNow),
              ElementsAre(HasSubstr("nothing was heard: start relocd (systemctl start relocd")));
}

TEST(StatusReportTest, NamesAMissingSupervisor) {
  StatusReport report;
  report.Handle(Pose(10ms));
  EXPECT_THAT(report.Problems(kNow), ElementsAre(HasSubstr("relocd does not run")));
}

TEST(StatusReportTest, NamesTheProcessThatIsNotReadyAndWhy) {
  StatusReport report = Well();
  process_t killed = Process("smootherd", process_t::BACKOFF);
  killed.last_exit_code = 137;
  process_t failed = Process("inferenced", process_t::FAILED);
  failed.last_exit_code = 78;
  report.Handle(Table({killed, failed}));
  EXPECT_THAT(report.Problems(kNow),
              ElementsAre("smootherd is BACKOFF (ended by signal 9)",
                          HasSubstr("inferenced is FAILED (ended with exit code 78): its input is "
                                    "wrong, see journalctl -u relocd")));
}

TEST(StatusReportTest, PassesOnWhatADaemonComplainsAbout) {
  StatusReport report = Well();
  report.Handle(Status("camerad_front", status_t::WARNING, "12.1 of 30 Hz"));
  EXPECT_THAT(report.Problems(kNow), ElementsAre("camerad_front: WARNING: 12.1 of 30 Hz"));
}

TEST(StatusReportTest, NamesAPoseThatIsBadOrOld) {
  StatusReport report = Well();
  report.Handle(Pose(2s, localization_t::DEAD_RECKONING));
  EXPECT_THAT(report.Problems(kNow),
              ElementsAre("localization is DEAD_RECKONING", "the pose is 2.0 s old, may be 1 s"));
}

TEST(StatusReportTest, MissesThePoseOnlyWhereThereIsASmoother) {
  StatusReport without;
  without.Handle(Table({Process("recorderd", process_t::READY)}));
  EXPECT_THAT(without.Problems(kNow), IsEmpty());

  StatusReport with;
  with.Handle(Table({Process("smootherd", process_t::READY)}));
  EXPECT_THAT(with.Problems(kNow), ElementsAre(HasSubstr("no LOCALIZATION message was heard")));
}

TEST(StatusReportTest, ShowsTheTableAndThePose) {
  EXPECT_EQ(Well().Text(kNow),
            "process              state         pid         up restarts    memory  status\n"
            "odometryd            READY          42 1 h 02 min        0     12 MB  \n"
            "smootherd            READY          42 1 h 02 min        0     12 MB  \n"
            "localization OK: x 12.35 m, y -3.00 m, heading 90.0 deg; sigma 0.20 m, 0.6 deg; age "
            "10 ms; 100.0 Hz; 0 fixes, 0 rejected\n");
}

TEST(StatusReportTest, WritesJsonThatHostileTextsDoNotBreak) {
  StatusReport report = Well();
  report.Handle(Status("a\"b", status_t::ERROR, "line\none \\ two"));
  const std::string json = report.Json(kNow);
  EXPECT_THAT(json,
              HasSubstr(R"({"ok": false, "problems": ["a\"b: ERROR: line\u000aone \\ two"])"));
  EXPECT_THAT(json, HasSubstr(R"("rate_hz": 100)"));
  EXPECT_THAT(json, HasSubstr(R"("sigma_position_m": 0.2)"));
}

TEST(StatusReportTest, ListensToEveryDaemon) {
  InProcessBus bus;
  StatusReport report;
  report.Subscribe(bus);
  ASSERT_TRUE(bus.Publish(channels::kSupervisor, Table({Process("odometryd", process_t::READY)})));
  ASSERT_TRUE(bus.Publish(StatusChannel("camerad_front"), Status("camerad_front", 2, "no camera")));
  bus.HandlePending();
  EXPECT_THAT(report.Problems(kNow), ElementsAre("camerad_front: ERROR: no camera"));
}

}  // namespace
}  // namespace relocd
