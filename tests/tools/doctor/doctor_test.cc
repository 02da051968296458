#include "doctor.h"

#include <map>
#include <set>
#include <string>
#include <vector>

#include <fmt/ranges.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/run_program.h"
#include "support/temporary_folder.h"

namespace relocd {
namespace {

using testing::AllOf;
using testing::EndsWith;
using testing::HasSubstr;
using testing::StartsWith;

const std::string kRouteHeader =
    "Iface\tDestination\tGateway\tFlags\tRefCnt\tUse\tMetric\tMask\tMTU\tWindow\tIRTT\n";
const std::string kDefaultRoute = "eth0\t00000000\t0100000A\t0003\t0\t0\t0\t00000000\t0\t0\t0\n";
const std::string kLcmRoute = "lo\t004CFFEF\t00000000\t0001\t0\t0\t0\t00FFFFFF\t0\t0\t0\n";
const std::string kCanDetails =
    "3: can0: <NOARP,UP,LOWER_UP,ECHO> mtu 16 qdisc pfifo_fast state UP mode DEFAULT\n"
    "    can state ERROR-ACTIVE restart-ms 100\n          bitrate 500000 sample-point 0.875\n";

/// A robot on which all is well, until a test changes it.
class FakeMachine final : public SystemProbes {
 public:
  std::map<std::string, std::string> files{
      {"/proc/net/route", kRouteHeader + kDefaultRoute + kLcmRoute},
      {"/sys/class/net/lo/flags", "0x9\n"},
      {"/sys/class/net/can0/flags", "0x40081\n"},
      {"/proc/sys/net/core/rmem_max", "4194304\n"},
      {"/proc/net/udp",
       "  sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   uid\n"
       "  1: 00000000:1DF3 00000000:0000 07 00000000:00000000 00:00000000 00000000   995 0\n"}};
  std::set<std::string> paths{"/dev/video0"};
  std::map<std::string, std::string> outputs{
      {"systemctl show relocd.service -p ActiveState --value", "active\n"},
      {"systemctl show relocd.service -p LimitRTPRIO --value", "20\n"},
      {"id -u relocd", "995\n"},
      {"id -nG relocd", "relocd video\n"},
      {"ip -details link show can0", kCanDetails}};
  std::optional<std::int64_t> free_bytes = 50'000'000'000;
  std::string loop_back_error;
  bool clock_is_synchronized = true;
  Result<std::string> camera_offers = std::string("MJPG 640 x 480 px at 30 Hz; no controls");
  Result<MapCamera> map_camera = MapCamera{.width = 640, .height = 480};

  std::optional<std::string> Read(const std::string& path) override {
    const auto found = files.find(path);
    return found == files.end() ? std::nullopt : std::optional(found->second);
  }
  bool Exists(const std::string& path) override { return paths.count(path) != 0; }
  std::optional<std::string> Output(const std::vector<std::string>& command) override {
    const auto found = outputs.find(fmt::format("{}", fmt::join(command, " ")));
    return found == outputs.end() ? std::nullopt : std::optional(found->second);
  }
  std::optional<std::int64_t> FreeBytes(const std::string& /*folder*/) override {
    return free_bytes;
  }
  Result<void> LoopBack(const std::string& /*lcm_url*/) override {
    if (loop_back_error.empty()) return {};
    return Error{ErrorKind::kUnavailable, loop_back_error};
  }
  bool IsClockSynchronized() override { return clock_is_synchronized; }
  Result<MapCamera> ReadMapCamera(const std::string& /*path*/) override { return map_camera; }
  Result<std::string> DescribeCamera(const CameraConfig& /*config*/) override {
    return camera_offers;
  }
};

class DoctorTest : public testing::Test {
 protected:
  DoctorTest() { config_.inference.map_path = "/var/lib/relocd/maps/site.relocmap"; }

  /// The finding of this name; the others are all ok.
  Finding Only(const std::string& name) {
    Finding wanted;
    for (const Finding& finding : Examine(config_, "/etc/relocd/robot.yaml", machine_)) {
      if (finding.name == name) {
        wanted = finding;
      } else {
        EXPECT_TRUE(finding.is_ok) << finding.name << ": " << finding.found;
      }
    }
    EXPECT_EQ(wanted.name, name);
    EXPECT_EQ(wanted.is_ok, wanted.command.empty());
    return wanted;
  }

  Config config_;
  FakeMachine machine_;
};

TEST_F(DoctorTest, FindsNothingOnARobotOnWhichAllIsWell) {
  const auto findings = Examine(config_, "/etc/relocd/robot.yaml", machine_);
  EXPECT_TRUE(IsAllOk(findings)) << FormatFindings(findings);
  for (const Finding& finding : findings)
    EXPECT_FALSE(finding.found.empty()) << finding.name;
}

TEST_F(DoctorTest, AMissingRouteIsMendedByOne) {
  machine_.files["/proc/net/route"] = kRouteHeader;
  const Finding finding = Only("lcm route");
  EXPECT_EQ(finding.found, "there is none to 239.255.76.67");
  EXPECT_THAT(finding.command,
              EndsWith("sudo ip route replace 239.255.76.0/24 dev lo src 127.0.0.1"));
}

TEST_F(DoctorTest, TheDefaultRouteIsTheWrongOne) {
  machine_.files["/proc/net/route"] = kRouteHeader + kDefaultRoute;
  EXPECT_EQ(Only("lcm route").found,
            "239.255.76.67 goes to eth0, must stay within this machine (lo)");
}

TEST_F(DoctorTest, TheMoreParticularRouteCounts) {
  machine_.files["/proc/net/route"] = kRouteHeader + kLcmRoute + kDefaultRoute;
  EXPECT_TRUE(Only("lcm route").is_ok);
}

TEST_F(DoctorTest, GarbageInTheRoutingTableIsNoRoute) {
  machine_.files["/proc/net/route"] = "lo 004CFFEX 0 1 0 0 0 00FFFFFF\nlo\n\nlo 1 2 3 4 5 6 \n";
  EXPECT_FALSE(Only("lcm route").is_ok);
}

TEST_F(DoctorTest, ALoopThatIsDownIsSaid) {
  machine_.files["/sys/class/net/lo/flags"] = "0x8\n";
  EXPECT_EQ(Only("lcm route").command, "sudo ip link set lo up");
}

TEST_F(DoctorTest, MessagesThatDoNotComeBackAreSaid) {
  machine_.loop_back_error = "a message did not come back within 1 s";
  const auto findings = Examine(config_, "", machine_);
  EXPECT_THAT(FormatFindings(findings),
              HasSubstr("FAIL lcm control    udpm://239.255.76.67:7667?ttl=0: a message did not "
                        "come back within 1 s: sudo systemctl restart relocd-lcm-route\n"));
}

TEST_F(DoctorTest, AStrangerOnAnLcmPortIsNamed) {
  machine_.files["/proc/net/udp"] +=
      "  2: 00000000:1DF4 00000000:0000 07 00000000:00000000 00:00000000 00000000  1000 0\n";
  const Finding finding = Only("image port");
  EXPECT_EQ(finding.found, "a process of user 1000 listens on UDP port 7668 too");
  EXPECT_EQ(finding.command, "sudo ss -ulpn 'sport = :7668'");
}

TEST_F(DoctorTest, AReceiveBufferBelowWhatImagesAskForIsSaid) {
  machine_.files["/proc/sys/net/core/rmem_max"] = "212992\n";
  EXPECT_EQ(Only("receive buffer").command, "sudo sysctl -w net.core.rmem_max=4194304");
}

TEST_F(DoctorTest, ABusThatIsNotThereIsSaid) {
  machine_.files.erase("/sys/class/net/can0/flags");
  EXPECT_EQ(Only("can").found, "there is no interface can0");
}

TEST_F(DoctorTest, ABusThatIsDownIsBroughtUpWithItsRestart) {
  machine_.files["/sys/class/net/can0/flags"] = "0x40080\n";
  EXPECT_EQ(Only("can").command, "sudo ip link set can0 up type can bitrate 500000 restart-ms 100");
}

TEST_F(DoctorTest, AVirtualBusNeedsNoBitRate) {
  machine_.files["/sys/class/net/can0/flags"] = "0x80\n";
  machine_.outputs["ip -details link show can0"] = "2: can0: <NOARP>\n link/can\n vcan\n";
  EXPECT_EQ(Only("can").command, "sudo ip link set can0 up");
  machine_.files["/sys/class/net/can0/flags"] = "0x81\n";
  EXPECT_TRUE(Only("can").is_ok);
}

TEST_F(DoctorTest, AControllerThatStaysOffTheBusIsSaid) {
  for (const std::string details :
       {"can state ERROR-ACTIVE restart-ms 0", "can state ERROR-ACTIVE"}) {
    machine_.outputs["ip -details link show can0"] = details;
    EXPECT_THAT(Only("can").found, HasSubstr("restart-ms 0")) << details;
    EXPECT_EQ(Only("can").command,
              "sudo ip link set can0 down; sudo ip link set can0 type can restart-ms 100; "
              "sudo ip link set can0 up");
  }
}

TEST_F(DoctorTest, AnAdapterThatCannotRestartIsLeftAlone) {
  machine_.outputs["ip -details link show can0"] = "can state ERROR-ACTIVE restart-ms 0";
  machine_.files["/etc/systemd/network/80-can0.network.d/no-restart.conf"] =
      "[CAN]\nRestartSec=0\n";
  EXPECT_TRUE(Only("can").is_ok);
}

TEST_F(DoctorTest, AServiceUserWhoMayNotOpenCamerasIsSaid) {
  machine_.outputs["id -nG relocd"] = "relocd\n";
  EXPECT_THAT(Only("group video").command, StartsWith("sudo adduser relocd video"));
  machine_.outputs.erase("id -nG relocd");
  EXPECT_EQ(Only("group video").command, "sudo systemd-sysusers relocd.conf");
}

TEST_F(DoctorTest, SaysWhatTheCameraOffers) {
  const auto found = [this] {
    const auto findings = Examine(config_, "/etc/relocd/robot.yaml", machine_);
    return std::ranges::find(findings, "camera front", &Finding::name)->found;
  };
  EXPECT_EQ(found(), "/dev/video0: MJPG 640 x 480 px at 30 Hz; no controls");
  machine_.camera_offers = Error{ErrorKind::kUnavailable, "permission denied"};
  EXPECT_EQ(found(), "/dev/video0 is there");
}

TEST_F(DoctorTest, ACameraThatIsNotThereIsNamedWithItsKey) {
  machine_.paths.clear();
  const Finding finding = Only("camera front");
  EXPECT_EQ(finding.found, "/dev/video0 is not there");
  EXPECT_THAT(finding.command, HasSubstr("cameras.front.device"));
}

TEST_F(DoctorTest, AMissingMapLeavesDeadReckoning) {
  machine_.map_camera = Error{ErrorKind::kInvalidInput, "x.relocmap: no such file"};
  EXPECT_THAT(Only("map"),
              AllOf(testing::Field(&Finding::found,
                                   "x.relocmap: no such file: there is dead reckoning only"),
                    testing::Field(&Finding::command, StartsWith("reloc map train"))));
}

TEST_F(DoctorTest, AMapOfAnotherCameraIsSaid) {
  machine_.map_camera = SystemProbes::MapCamera{.width = 853, .height = 480};
  EXPECT_EQ(Only("map").found, "is made for 853 x 480 px, cameras.front gives 640 x 480");
}

TEST_F(DoctorTest, AClockThatNobodyKeepsIsSaid) {
  machine_.clock_is_synchronized = false;
  EXPECT_EQ(Only("clock").command, "sudo timedatectl set-ntp true");
}

TEST_F(DoctorTest, TheDiskMustHoldOneMoreSegment) {
  machine_.free_bytes = 1'256'000'000;  // the defaults' 1000 and 256 MB
  EXPECT_TRUE(Only("disk").is_ok);
  machine_.free_bytes = 1'255'000'000;
  EXPECT_THAT(Only("disk").found, HasSubstr("has 1255 MB free, needs 1256"));
}

TEST_F(DoctorTest, ALimitBelowTheHighestPriorityIsSaid) {
  machine_.outputs["systemctl show relocd.service -p LimitRTPRIO --value"] = "19\n";
  EXPECT_THAT(Only("real time").found, HasSubstr("is 19, priority 20 is asked for"));
  config_.supervisor.odometryd.enabled = false;
  EXPECT_TRUE(Only("real time").is_ok);
}

TEST_F(DoctorTest, AServiceThatFailedIsSaid) {
  machine_.outputs["systemctl show relocd.service -p ActiveState --value"] = "failed\n";
  EXPECT_EQ(Only("service").command,
            "reloc check-config /etc/relocd/robot.yaml && sudo systemctl restart relocd");
}

TEST_F(DoctorTest, ScriptsReadJson) {
  const std::vector<Finding> findings{
      {.name = "can", .is_ok = false, .found = "say \"x\"\n", .command = "a\\b"}};
  EXPECT_EQ(FormatFindingsAsJson(findings),
            R"({"ok": false, "checks": [{"name": "can", "ok": false, "found": "say \"x\"\u000a", )"
            R"("command": "a\\b"}]})"
            "\n");
}

TEST(DoctorProgramTest, AWrongConfigEndsWithTheExitCodeForIt) {
  const TemporaryFolder folder;
  const std::string path = folder.Write("robot.yaml", "can: {interfce: can0}\n");
  const Ended ended = RunProgram(std::string(DOCTOR_PROGRAM) + " --json --config " + path);
  EXPECT_EQ(ended.exit_code, 78);
  EXPECT_THAT(ended.output,
              StartsWith(R"({"ok": false, "checks": [{"name": "config", "ok": false)"));
  EXPECT_THAT(ended.output, HasSubstr("line 1"));
}

}  // namespace
}  // namespace relocd
