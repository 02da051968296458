#include "recording/log_reader.h"

#include <errno.h>

#include <array>
#include <system_error>
#include <utility>

#include <fmt/format.h>

namespace relocd {
namespace {

template <typename Number>
Number ReadBigEndian(const char* bytes) {
  Number number = 0;
  for (std::size_t i = 0; i < sizeof(Number); ++i) {
    number = static_cast<Number>(number << 8 | static_cast<std::uint8_t>(bytes[i]));
  }
  return number;
}

}  // namespace

Result<LogReader> LogReader::Open(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) {
    return Error{ErrorKind::kUnavailable,
                 fmt::format("opening log {}: {}", path, std::generic_category().message(errno))};
  }
  return LogReader(std::move(file));
}

std::optional<LogEvent> LogReader::ReadEvent() {
  using namespace log_format;
  std::array<char, kHeaderSize> header{};
  if (!file_.read(header.data(), header.size())) return std::nullopt;
  if (ReadBigEndian<std::uint32_t>(header.data()) != kSyncWord) return std::nullopt;
  const auto channel_size = ReadBigEndian<std::uint32_t>(header.data() + 20);
  const auto data_size = ReadBigEndian<std::uint32_t>(header.data() + 24);
  if (channel_size == 0 || channel_size > kMaxChannelSize || data_size > kMaxDataSize) {
    return std::nullopt;
  }
  LogEvent event;
  event.number = ReadBigEndian<std::int64_t>(header.data() + 4);
  event.timestamp_us = ReadBigEndian<std::int64_t>(header.data() + 12);
  event.channel.resize(channel_size);
  event.data.resize(data_size);
  if (!file_.read(event.channel.data(), channel_size)) return std::nullopt;
  if (!file_.read(reinterpret_cast<char*>(event.data.data()), data_size)) return std::nullopt;
  return event;
}

std::optional<LogEvent> LogReader::Next() {
  bool damaged = false;
  while (true) {
    file_.clear();
    const auto begin = file_.tellg();
    if (file_.peek() == std::ifstream::traits_type::eof()) return std::nullopt;
    if (auto event = ReadEvent()) {
      ++counters_.events;
      return event;
    }
    if (!std::exchange(damaged, true)) ++counters_.damaged_places;
    ++counters_.skipped_bytes;
    file_.clear();
    file_.seekg(begin + std::streamoff{1});
  }
}

}  // namespace relocd
