#pragma once

#include <cstdint>

#include "relocd/image_t.hpp"

#include "camera/frame_source.h"

namespace relocd {

/// Which message of its publisher an image is, and when it was taken on the wall clock.
struct ImageStamp {
  std::int64_t utime = 0;  ///< us, CLOCK_REALTIME.
  std::int64_t seq = 0;
  std::int64_t run_id = 0;
};

/// A camera's frame as it stands in IMAGE_<camera>.
image_t ToMessage(Frame frame, const ImageStamp& stamp);

}  // namespace relocd
