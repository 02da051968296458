#include "recording/log_event.h"

namespace relocd::log_format {
namespace {

template <typename Number>
void AppendBigEndian(Number number, std::string& out) {
  for (int shift = static_cast<int>(sizeof(Number)) * 8 - 8; shift >= 0; shift -= 8) {
    out.push_back(static_cast<char>(number >> shift & 0xFF));
  }
}

}  // namespace

void AppendEvent(std::int64_t number,
                 std::int64_t timestamp_us,
                 std::string_view channel,
                 std::span<const std::uint8_t> data,
                 std::string& out) {
  AppendBigEndian(kSyncWord, out);
  AppendBigEndian(static_cast<std::uint64_t>(number), out);
  AppendBigEndian(static_cast<std::uint64_t>(timestamp_us), out);
  AppendBigEndian(static_cast<std::uint32_t>(channel.size()), out);
  AppendBigEndian(static_cast<std::uint32_t>(data.size()), out);
  out.append(channel);
  out.append(reinterpret_cast<const char*>(data.data()), data.size());
}

}  // namespace relocd::log_format
