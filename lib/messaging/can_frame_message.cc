#include "messaging/can_frame_message.h"

namespace relocd {

can_frame_t ToMessage(const CanFrame& frame) {
  can_frame_t message{};
  message.mono_ns = ToNanoseconds(frame.receive_time);
  // The kernel's flags are in the topmost bits of an unsigned number.
  message.can_id = static_cast<std::int32_t>(KernelCanId(frame));
  message.size = frame.size;
  message.data.assign(frame.payload().begin(), frame.payload().end());
  return message;
}

CanFrame FromMessage(const can_frame_t& message) {
  CanFrame frame;
  SetKernelCanId(frame, static_cast<std::uint32_t>(message.can_id));
  frame.receive_time = FromNanoseconds(message.mono_ns);
  frame.SetPayload(message.data);
  frame.fd = frame.size > CanFrame::kMaxClassicalSize;
  return frame;
}

}  // namespace relocd
