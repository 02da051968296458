#include "base64.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>

namespace relocd {

std::string EncodeBase64(std::string_view bytes) {
  constexpr std::string_view kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  constexpr std::size_t kGroup = 3;
  constexpr std::uint32_t kSixBits = 0x3F;
  std::string text;
  text.reserve((bytes.size() + kGroup - 1) / kGroup * 4);
  for (std::size_t i = 0; i < bytes.size(); i += kGroup) {
    const std::size_t size = std::min(kGroup, bytes.size() - i);
    std::uint32_t group = 0;
    for (std::size_t k = 0; k < kGroup; ++k)
      group = group << 8U | (k < size ? static_cast<unsigned char>(bytes[i + k]) : 0U);
    for (std::size_t k = 0; k <= kGroup; ++k)
      text += k <= size ? kDigits[group >> (6U * (kGroup - k)) & kSixBits] : '=';
  }
  return text;
}

}  // namespace relocd
