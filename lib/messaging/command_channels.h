#pragma once

#include "relocd/pose_t.hpp"
#include "relocd/text_t.hpp"

#include "messaging/channels.h"

namespace relocd {

/// What a person, or another program, may ask of the daemons on the control network.
namespace command_channels {

/// The body is there, from now on: `reloc set-pose`.
inline const Channel<pose_t> kSetPose{"SET_POSE"};
/// The pose is to be forgotten; the text says why: `reloc reset`.
inline const Channel<text_t> kReset{"RESET"};

}  // namespace command_channels
}  // namespace relocd
