#include "can/signal_reader.h"

#include <utility>

#include "can/signal.h"

namespace relocd {

Result<SignalReader> SignalReader::Create(const std::string& full_name,
                                          const DbcFile& dbc,
                                          const std::map<std::string, MessageRule>& rules) {
  auto found = dbc.FindSignal(full_name);
  if (!found) return std::move(found).error();
  const auto rule = rules.find(found->message->name);
  auto guard =
      MessageGuard::Create(rule == rules.end() ? MessageRule() : rule->second, *found->message);
  if (!guard) return std::move(guard).error().WithContext(dbc.path());
  return SignalReader(*found->message, *found->signal, std::move(guard).value());
}

std::optional<double> SignalReader::Handle(const CanFrame& frame) {
  if (frame.id != message_.id || frame.error || frame.remote) return std::nullopt;
  if (guard_.Judge(frame).verdict != FrameVerdict::kValid) return std::nullopt;
  if (!IsPresent(message_, signal_, frame.payload())) return std::nullopt;
  const auto value = DecodeSignal(signal_, frame.payload());
  if (!value) {
    guard_.CountNonFinite();
    return std::nullopt;
  }
  value_ = value;
  value_time_ = frame.receive_time;
  return value;
}

}  // namespace relocd
