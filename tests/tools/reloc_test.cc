#include <poll.h>
#include <unistd.h>

#include <string>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/file.h"
#include "supervision/child_process.h"
#include "support/temporary_folder.h"

namespace relocd {
namespace {

using testing::HasSubstr;

struct Outcome {
  int exit_code = -1;
  std::string output{};  ///< Of both stdout and stderr.
};

/// Runs `reloc <arguments>`.
Outcome Reloc(const std::string& arguments) {
  const TemporaryFolder folder;
  const std::string path = folder.path() + "/output";
  const std::string command = fmt::format("exec {} {} >{} 2>&1", RELOC_PROGRAM, arguments, path);
  auto process = ChildProcess::Start({.command = {"/bin/sh", "-c", command}});
  EXPECT_TRUE(process);
  pollfd ended{.fd = process->fd(), .events = POLLIN, .revents = 0};
  EXPECT_EQ(::poll(&ended, 1, 10'000), 1) << "did not end";
  Outcome outcome{.exit_code = process->Reap().value_or(-1)};
  outcome.output = ReadFile(path).value();
  return outcome;
}

TEST(RelocTest, ListsItsVerbs) {
  for (const char* arguments : {"", "help", "--help"}) {
    const Outcome outcome = Reloc(arguments);
    EXPECT_EQ(outcome.exit_code, 0);
    EXPECT_THAT(outcome.output, HasSubstr("  check-config   whether a robot's config is right\n"));
  }
}

TEST(RelocTest, SaysItsVersion) {
  const Outcome outcome = Reloc("--version");
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_THAT(outcome.output, testing::MatchesRegex("reloc [0-9]+\\.[0-9]+\\.[0-9]+\n"));
}

TEST(RelocTest, BecomesTheVerbsProgramWithAllArguments) {
  const Outcome outcome = Reloc("check-config --defaults");
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_THAT(outcome.output, HasSubstr("control_url:"));
}

TEST(RelocTest, GivesTheVerbsExitCode) {
  EXPECT_EQ(Reloc("check-config /nowhere/robot.yaml").exit_code, 1);
  EXPECT_EQ(Reloc("check-config --no-such-option").exit_code, 2);
}

TEST(RelocTest, NamesTheNearestVerbOfAnUnknownOne) {
  const Outcome outcome = Reloc("check-confg");
  EXPECT_EQ(outcome.exit_code, 2);
  EXPECT_EQ(outcome.output,
            "reloc: unknown verb 'check-confg', did you mean 'check-config'? the verbs are listed "
            "by: reloc help\n");
}

TEST(RelocTest, LogTellsAFileThatIsNoLogFromAnEmptyOne) {
  const TemporaryFolder folder;
  const std::string table = folder.Write("x.csv", "time_ns,x_m\n0,1\n");
  for (const std::string& verb :
       {"info " + table, "status " + table, "export --channel ODOMETRY --out /dev/null " + table}) {
    const Outcome outcome = Reloc("log " + verb);
    EXPECT_EQ(outcome.exit_code, 78);
    EXPECT_THAT(outcome.output,
                testing::StartsWith("reloc log: log " + table + ": has no message"));
  }
  const Outcome empty =
      Reloc("log export --channel ODOMETRY --out /dev/null " + folder.Write("x.lcmlog", ""));
  EXPECT_EQ(empty.exit_code, 0);
  EXPECT_THAT(empty.output, HasSubstr("x.lcmlog: has no message on ODOMETRY\n"));
}

TEST(RelocTest, RunsNothingOutsideItsDirectory) {
  EXPECT_EQ(Reloc("/../../../bin/true").exit_code, 2);
  EXPECT_EQ(Reloc("''").exit_code, 2);
}

}  // namespace
}  // namespace relocd
