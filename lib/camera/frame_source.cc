#include "camera/frame_source.h"

namespace relocd {

std::string FourccText(std::uint32_t fourcc) {
  std::string text;
  for (unsigned shift = 0; shift < 32; shift += 8) {
    const auto code = static_cast<unsigned char>(fourcc >> shift & 0xFFU);
    text += code > 0x20 && code < 0x7F ? static_cast<char>(code) : '.';
  }
  return text;
}

}  // namespace relocd
