#pragma once

#include "relocd/can_frame_t.hpp"

#include "can/can_frame.h"

namespace relocd {

/// A frame as it stands in CAN_<interface>, and back.
can_frame_t ToMessage(const CanFrame& frame);
CanFrame FromMessage(const can_frame_t& message);

}  // namespace relocd
