#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include <chrono>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/file.h"
#include "core/time.h"
#include "core/unique_fd.h"
#include "scene_coordinates/test_map.h"
#include "supervision/child_process.h"
#include "supervision/notify_server.h"
#include "support/temporary_folder.h"

namespace relocd {
namespace {

using namespace std::chrono_literals;
using testing::ContainsRegex;
using testing::HasSubstr;

/// The real relocd, with test children and without the daemons. What it logs goes to a file, what
/// it tells systemd comes here.
class RelocdProcessTest : public testing::Test {
 protected:
  RelocdProcessTest() {
    auto notify = NotifyServer::Open();
    EXPECT_TRUE(notify);
    notify_.emplace(std::move(notify).value());
  }

  /// A config with the test children `first` and `second`.
  [[nodiscard]] std::string ConfigText(const std::string& second_steps) const {
    std::string text = "bus: {control_url: \"memq://\", image_url: \"memq://\"}\nsupervisor:\n";
    for (const char* daemon : {"recorderd", "smootherd", "inferenced", "odometryd", "camerad"})
      text += fmt::format("  {}: {{enabled: false, after: []}}\n", daemon);
    text += fmt::format(
        "  others:\n"
        "    first: {{command: [{0}, first, {1}children.log, ready, wait]}}\n"
        "    second: {{command: [{0}, second, {1}children.log, {2}], after: [first]}}\n",
        RELOCD_TEST_CHILD,
        directory_,
        second_steps);
    return text;
  }

  void WriteConfig(const std::string& text) {
    ASSERT_TRUE(WriteFileAtomically(directory_ + "robot.yaml", text));
  }

  [[nodiscard]] std::string Command(const std::string& arguments) const {
    return fmt::format(
        "exec {} --config {}robot.yaml {} 2>>{}", RELOCD_PROGRAM, directory_, arguments, log_);
  }

  void StartRelocd(const std::string& arguments = "") {
    auto process = ChildProcess::Start({.command = {"/bin/sh", "-c", Command(arguments)},
                                        .environment = {"NOTIFY_SOCKET=" + notify_->address(),
                                                        "RUNTIME_DIRECTORY=" + directory_}});
    ASSERT_TRUE(process) << process.error().message;
    relocd_.emplace(std::move(process).value());
  }

  /// Of a relocd that ends by itself.
  [[nodiscard]] int ExitCodeOf(const std::string& arguments) const {
    auto process = ChildProcess::Start({.command = {"/bin/sh", "-c", Command(arguments)},
                                        .environment = {"RUNTIME_DIRECTORY=" + directory_}});
    EXPECT_TRUE(process);
    pollfd ended{.fd = process->fd(), .events = POLLIN, .revents = 0};
    EXPECT_EQ(::poll(&ended, 1, 5000), 1) << "did not end";
    return process->Reap().value_or(-1);
  }

  void WaitUntil(const std::function<bool()>& is_so) const {
    const MonotonicTime begin = MonotonicClock::now();
    while (!is_so()) {
      if (MonotonicClock::now() - begin > 8s) {
        ADD_FAILURE() << "took too long; log:\n" << Text("relocd.log");
        return;
      }
      pollfd ready{.fd = notify_->fd(), .events = POLLIN, .revents = 0};
      ::poll(&ready, 1, 5);
    }
  }

  /// Takes in what relocd told its service manager.
  bool HasSaidReady() {
    while (auto notification = notify_->Receive(relocd_->pid())) {
      is_ready_ = is_ready_ || notification->ready;
      is_stopping_ = is_stopping_ || notification->stopping;
      if (notification->status) status_ = *notification->status;
    }
    return is_ready_;
  }
  bool HasStatus(const std::string& status) {
    HasSaidReady();
    return status_ == status;
  }

  [[nodiscard]] std::string Text(const std::string& file) const {
    auto text = ReadFile(directory_ + file);
    return text ? *text : "";
  }

  TemporaryFolder folder_;
  std::string directory_ = folder_.path() + "/";
  std::string log_ = directory_ + "relocd.log";
  std::optional<NotifyServer> notify_;
  std::optional<ChildProcess> relocd_;
  bool is_ready_ = false;
  bool is_stopping_ = false;
  std::string status_;
};

TEST_F(RelocdProcessTest, StartsItsChildrenSaysReadyAndStopsThem) {
  WriteConfig(ConfigText("ready, wait"));
  StartRelocd();
  WaitUntil([&] { return HasSaidReady() && HasStatus("2/2 ready"); });
  EXPECT_EQ(Text("children.log"), "first start\nsecond start\n");

  relocd_->Signal(SIGTERM);
  std::optional<int> exit_code;
  WaitUntil([&] {
    HasSaidReady();
    exit_code = relocd_->Reap();
    return exit_code.has_value();
  });
  EXPECT_EQ(exit_code, 0);
  EXPECT_TRUE(is_stopping_);
  EXPECT_THAT(Text("children.log"), HasSubstr("first term\n"));
  EXPECT_THAT(Text("children.log"), HasSubstr("second term\n"));
}

TEST_F(RelocdProcessTest, KillsItsChildrenWhenAskedTwice) {
  WriteConfig(ConfigText("ignore-term, ready, wait"));
  StartRelocd();
  WaitUntil([&] { return HasStatus("2/2 ready"); });
  relocd_->Signal(SIGTERM);
  WaitUntil([&] { return HasStatus("0/2 ready; first STOPPED (exit code 0); second STOPPING"); });
  relocd_->Signal(SIGINT);
  std::optional<int> exit_code;
  WaitUntil([&] { return (exit_code = relocd_->Reap()).has_value(); });
  EXPECT_EQ(exit_code, 0);
  EXPECT_THAT(Text("relocd.log"), HasSubstr("asked twice to stop: killing what still runs"));
}

TEST_F(RelocdProcessTest, KeepsItsConfigWhenTheNewOneIsBad) {
  WriteConfig(ConfigText("ready, wait"));
  StartRelocd();
  WaitUntil([&] { return HasStatus("2/2 ready"); });

  WriteConfig("supervisor:\n  playback_delay: 1\n");
  relocd_->Signal(SIGHUP);
  WaitUntil([&] { return Text("relocd.log").find("stays as it was") != std::string::npos; });
  EXPECT_THAT(Text("relocd.log"),
              HasSubstr("robot.yaml: line 2: unknown key 'supervisor.playback_delay'"));
  EXPECT_EQ(Text("children.log"), "first start\nsecond start\n") << "nobody was touched";

  WriteConfig(ConfigText("status:new, ready, wait"));
  relocd_->Signal(SIGHUP);
  WaitUntil([&] {
    return Text("children.log") == "first start\nsecond start\nsecond term\nsecond start\n";
  });
}

TEST_F(RelocdProcessTest, RunsItsChildrenWithoutLcm) {
  WriteConfig(ConfigText("ready, wait"));
  StartRelocd("--lcm-url file:///nowhere/log.lcm?mode=w");
  WaitUntil([&] { return HasStatus("2/2 ready"); });
  WaitUntil([&] {
    return Text("relocd.log").find("<3>relocd: opening LCM at 'file:///nowhere/log.lcm?mode=w'") !=
           std::string::npos;
  });
}

TEST_F(RelocdProcessTest, RunsOnWhenItsLogTakesNothing) {
  log_ = "/dev/full";
  WriteConfig(ConfigText("ready, wait"));
  StartRelocd();
  WaitUntil([&] { return HasStatus("2/2 ready"); });
}

TEST_F(RelocdProcessTest, RunsOnWhenNobodyReadsItsLog) {
  log_ = directory_ + "pipe";
  ASSERT_EQ(::mkfifo(log_.c_str(), 0600), 0);
  UniqueFd reader(::open(log_.c_str(), O_RDONLY | O_NONBLOCK));
  WriteConfig(ConfigText("ready, wait"));
  StartRelocd();
  WaitUntil([&] { return HasStatus("2/2 ready"); });
  reader = UniqueFd();
  WriteConfig(ConfigText("status:new, ready, wait"));
  relocd_->Signal(SIGHUP);  // is told in the log
  WaitUntil([&] {
    return Text("children.log") == "first start\nsecond start\nsecond term\nsecond start\n";
  });
  EXPECT_FALSE(relocd_->Reap());
}

TEST_F(RelocdProcessTest, WaitsForAMapThatComesSlowlyAndNotForOneThatDoesNotCome) {
  const std::string path = directory_ + "site.relocmap";
  ASSERT_EQ(::mkfifo(path.c_str(), 0600), 0);
  ::signal(SIGPIPE, SIG_IGN);  // a reader that was aborted is a failed check, not this test's end
  std::string text = "bus: {control_url: \"memq://\", image_url: \"memq://\"}\n";
  text += fmt::format("inference: {{map_path: {}}}\nsupervisor:\n", path);
  text += "  inferenced: {after: [], start_timeout_s: 1.5, watchdog_s: 1.5}\n";
  for (const char* daemon : {"recorderd", "smootherd", "odometryd", "camerad"})
    text += fmt::format("  {}: {{enabled: false, after: []}}\n", daemon);
  WriteConfig(text);
  StartRelocd();
  UniqueFd map;
  const auto is_read = [&] {
    map = UniqueFd(::open(path.c_str(), O_WRONLY | O_NONBLOCK | O_CLOEXEC));
    return map.valid();
  };

  WaitUntil(is_read);
  WaitUntil([&] { return Text("relocd.log").find("starts again") != std::string::npos; });
  EXPECT_THAT(Text("relocd.log"), HasSubstr("inferenced: gave no sign of life for"));
  map = UniqueFd();

  WaitUntil(is_read);
  const std::string bytes = SerializeMap(MakeTestMap());
  constexpr std::size_t kPieces = 20;
  const std::size_t piece = bytes.size() / kPieces + 1;
  for (std::size_t at = 0; at < bytes.size(); at += piece) {
    const std::string_view now = std::string_view(bytes).substr(at, piece);
    ASSERT_EQ(::write(map.get(), now.data(), now.size()), static_cast<ssize_t>(now.size()));
    ::poll(nullptr, 0, 100);
  }
  map = UniqueFd();
  WaitUntil([&] { return HasStatus("1/1 ready"); });
  EXPECT_THAT(Text("relocd.log"), ContainsRegex("inferenced: ready [2-9]\\.[0-9]+ s after"));
}

TEST_F(RelocdProcessTest, RefusesASecondCopy) {
  WriteConfig(ConfigText("ready, wait"));
  StartRelocd();
  WaitUntil([&] { return HasStatus("2/2 ready"); });
  EXPECT_EQ(ExitCodeOf(""), 1);
  EXPECT_THAT(Text("relocd.log"),
              HasSubstr(fmt::format("another relocd (pid {}) runs on memq://", relocd_->pid())));
}

TEST_F(RelocdProcessTest, TakesItsChildrenAlongWhenItIsKilled) {
  WriteConfig(ConfigText("ready, wait"));
  StartRelocd();
  WaitUntil([&] { return HasStatus("2/2 ready"); });
  const std::string children = fmt::format("/proc/{0}/task/{0}/children", relocd_->pid());
  const auto pids = ReadFile(children);
  ASSERT_TRUE(pids);
  const std::string first = pids->substr(0, pids->find(' '));
  ASSERT_FALSE(first.empty());
  relocd_->Signal(SIGKILL);
  WaitUntil([&] {
    const auto status = ReadFile("/proc/" + first + "/stat");
    return !status || status->find(") Z ") != std::string::npos;
  });
}

TEST_F(RelocdProcessTest, EndsWith78ForABadConfigAndNamesTheLine) {
  WriteConfig("supervisor:\n  odometryd:\n    watchdog_s: -1\n");
  EXPECT_EQ(ExitCodeOf(""), 78);
  EXPECT_THAT(Text("relocd.log"),
              HasSubstr("robot.yaml: line 3: supervisor.odometryd.watchdog_s is -1, must be 0 or "
                        "in [0.1, 3600]"));
}

TEST_F(RelocdProcessTest, ChecksAConfigWithoutStartingAnything) {
  WriteConfig(ConfigText("ready, wait"));
  EXPECT_EQ(ExitCodeOf("--check-config"), 0);
  EXPECT_EQ(Text("children.log"), "");
  EXPECT_EQ(ExitCodeOf("--no-such-option"), 2);
}

}  // namespace
}  // namespace relocd
