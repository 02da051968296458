#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace relocd {

/// One message of a log.
struct LogEvent {
  std::int64_t number = 0;  ///< 0, 1, 2, ... within the file.
  std::int64_t timestamp_us =
      0;  ///< CLOCK_REALTIME when it was recorded. The order in the file is the truth, not this.
  std::string channel;
  std::vector<std::uint8_t> data;
};

/// The file format of lcm-logger, all numbers big-endian: for each event the sync word, the event's
/// number (8 bytes), its time (8), the length of the channel's name (4), the length of the data
/// (4), the name, the data.
namespace log_format {

inline constexpr std::uint32_t kSyncWord = 0xEDA1DA01;
inline constexpr std::size_t kHeaderSize = 28;
/// More is damage. LCM allows 63 characters in a channel's name.
inline constexpr std::uint32_t kMaxChannelSize = 255;
inline constexpr std::uint32_t kMaxDataSize = 64U << 20;

/// Appends the event as it stands in a file.
void AppendEvent(std::int64_t number,
                 std::int64_t timestamp_us,
                 std::string_view channel,
                 std::span<const std::uint8_t> data,
                 std::string& out);

}  // namespace log_format
}  // namespace relocd
