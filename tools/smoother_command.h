#pragma once

#include <functional>
#include <string>

#include "core/result.h"
#include "messaging/message_bus.h"

namespace relocd {

/// Publishes a command to smootherd, and waits for a LOCALIZATION that shows what came of it.
///
/// @param is_done  whether this message shows it.
/// @return kUnavailable when the network is not there, or smootherd does not answer in two seconds.
Result<void> CommandSmoother(const std::string& lcm_url,
                             const std::function<Result<void>(MessageBus&)>& publish,
                             const std::function<bool(const localization_t&)>& is_done);

}  // namespace relocd
