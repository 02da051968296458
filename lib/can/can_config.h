#pragma once

#include <map>
#include <string>

#include "can/message_guard.h"
#include "core/result.h"

namespace relocd {

/// Where CAN frames come from, and what they mean.
struct CanConfig {
  std::string source = "socketcan";
  std::string interface = "can0";
  std::string path{};
  int fd = -1;
  bool fd_frames = false;
  double playback_start_s = 0.0;
  std::string dbc_file{};
  std::map<std::string, MessageRule> messages{};

  template <typename Self, typename Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("source",
          self.source,
          "socketcan, candump (a recorded log), unix (a SOCK_SEQPACKET socket of struct can_frame) "
          "or fd (such a socket, inherited)");
    visit(
        "interface",
        self.interface,
        "of letters, digits and _; the network interface of socketcan, the frames' interface in a "
        "candump log, and the name of the channel CAN_<interface>");
    visit("path", self.path, "file of candump, socket of unix; empty for the others");
    visit("fd", self.fd, ">= 0 with source fd, -1 otherwise; the inherited file descriptor");
    visit("fd_frames", self.fd_frames, "socketcan: also receive CAN FD frames");
    visit("playback_start_s",
          self.playback_start_s,
          ">= 0; candump: the recorded time at which playback begins");
    visit("dbc_file", self.dbc_file, "the signals of the vehicle, in DBC format");
    visit(
        "messages",
        self.messages,
        "by the name of a message in the DBC file: how it shows that it is new and whole (counter, "
        "counter_step, counter_modulo, checksum, checksum_rule, data_id, max_age_s)");
  }

  /// @return kInvalidInput, naming the field, its value and what is allowed.
  [[nodiscard]] Result<void> Validate() const;
};

}  // namespace relocd
