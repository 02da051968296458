#include "can/can_config.h"

#include <algorithm>
#include <cctype>
#include <cmath>

#include <fmt/format.h>

namespace relocd {
namespace {

Error Invalid(std::string message) {
  return {ErrorKind::kInvalidInput, std::move(message)};
}

/// It becomes part of a channel's name, which LCM reads as a regular expression.
bool IsChannelWord(const std::string& text) {
  return !text.empty() && std::all_of(text.begin(), text.end(), [](unsigned char c) {
    return std::isalnum(c) != 0 || c == '_';
  });
}

}  // namespace

Result<void> CanConfig::Validate() const {
  const bool needs_path = source == "candump" || source == "unix";
  if (source != "socketcan" && source != "fd" && !needs_path) {
    return Invalid(
        fmt::format("source is '{}', must be one of socketcan, candump, unix, fd", source));
  }
  if (!IsChannelWord(interface)) {
    return Invalid(fmt::format("interface is '{}', must be of letters, digits and _", interface));
  }
  if (needs_path && path.empty()) {
    return Invalid(fmt::format("path is empty, must name a file with source {}", source));
  }
  if (source == "fd" && fd < 0) {
    return Invalid(fmt::format("fd is {}, must be at least 0 with source fd", fd));
  }
  if (!(playback_start_s >= 0.0) || !std::isfinite(playback_start_s)) {
    return Invalid(
        fmt::format("playback_start_s is {}, must be finite and at least 0", playback_start_s));
  }
  for (const auto& [name, rule] : messages) {
    if (auto ok = rule.Validate(); !ok) {
      return Invalid(fmt::format("messages.{}.{}", name, ok.error().message));
    }
  }
  return {};
}

}  // namespace relocd
