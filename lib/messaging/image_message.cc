#include "messaging/image_message.h"

#include <utility>

#include "messaging/image_metadata.h"

namespace relocd {

image_t ToMessage(Frame frame, const ImageStamp& stamp) {
  image_t message{};
  message.utime = stamp.utime;
  message.width = frame.width;
  message.height = frame.height;
  message.row_stride = frame.bytes_per_line;
  message.pixelformat = static_cast<std::int32_t>(frame.fourcc);
  message.size = static_cast<std::int32_t>(frame.bytes.size());
  message.data = std::move(frame.bytes);
  SetImageMetadata({.mono_ns = ToNanoseconds(frame.time),
                    .seq = stamp.seq,
                    .run_id = stamp.run_id,
                    .flags = frame.flags,
                    .exposure_us = frame.exposure_us},
                   message);
  return message;
}

}  // namespace relocd
