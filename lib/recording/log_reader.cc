#include "recording/log_reader.h"

#include <errno.h>
#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "core/file.h"

namespace relocd {
namespace {

constexpr std::size_t kChunkSize = std::size_t{1} << 20;
constexpr std::size_t kSyncSize = 4;
using log_format::kSyncWord;

}  // namespace

Result<LogReader> LogReader::Open(const std::string& path) {
  UniqueFd fd(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (!fd.valid()) return SystemError(ErrorKind::kUnavailable, fmt::format("opening log {}", path));
  // Nothing is read, but what cannot be, as a folder, says so.
  if (::read(fd.get(), nullptr, 0) != 0) {
    return SystemError(ErrorKind::kUnavailable, fmt::format("reading log {}", path));
  }
  LogReader reader(std::move(fd));
  const bool is_begun = !reader.Has(kSyncSize) || reader.BigEndianAt(0, kSyncSize) == kSyncWord;
  reader.first_ = reader.FindEvent();
  if (!reader.first_ && !is_begun) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("log {}: has no message in {} bytes, must be of lcm-logger or "
                             "recorderd",
                             path,
                             reader.counters_.skipped_bytes)};
  }
  return reader;
}

bool LogReader::Has(std::size_t size) {
  while (buffer_.size() - begin_ < size) {
    buffer_.erase(0, std::exchange(begin_, 0));
    const std::size_t old_size = buffer_.size();
    buffer_.resize(old_size + kChunkSize);
    const ssize_t count = ::read(fd_.get(), buffer_.data() + old_size, kChunkSize);
    buffer_.resize(old_size + static_cast<std::size_t>(std::max<ssize_t>(count, 0)));
    if (count == 0 || (count < 0 && errno != EINTR)) return false;
  }
  return true;
}

std::uint64_t LogReader::BigEndianAt(std::size_t offset, std::size_t size) const {
  std::uint64_t number = 0;
  for (std::size_t i = 0; i < size; ++i) {
    number = number << 8 | static_cast<std::uint8_t>(buffer_[begin_ + offset + i]);
  }
  return number;
}

std::optional<LogEvent> LogReader::ReadEvent() {
  using log_format::kHeaderSize;
  using log_format::kMaxChannelSize;
  using log_format::kMaxDataSize;
  if (!Has(kHeaderSize) || BigEndianAt(0, kSyncSize) != kSyncWord) return std::nullopt;
  const std::size_t channel_size = BigEndianAt(20, 4);
  const std::size_t data_size = BigEndianAt(24, 4);
  if (channel_size == 0 || channel_size > kMaxChannelSize || data_size > kMaxDataSize) {
    return std::nullopt;
  }
  const std::size_t event_size = kHeaderSize + channel_size + data_size;
  if (!Has(event_size)) return std::nullopt;
  const bool another_follows = Has(event_size + kSyncSize);
  if (another_follows ? BigEndianAt(event_size, kSyncSize) != kSyncWord : Has(event_size + 1)) {
    return std::nullopt;
  }
  LogEvent event;
  event.number = static_cast<std::int64_t>(BigEndianAt(4, 8));
  event.timestamp_us = static_cast<std::int64_t>(BigEndianAt(12, 8));
  event.channel = buffer_.substr(begin_ + kHeaderSize, channel_size);
  const auto* data =
      reinterpret_cast<const std::uint8_t*>(buffer_.data()) + begin_ + kHeaderSize + channel_size;
  event.data.assign(data, data + data_size);
  begin_ += event_size;
  return event;
}

std::optional<LogEvent> LogReader::Next() {
  auto event = first_ ? std::exchange(first_, std::nullopt) : FindEvent();
  if (event) ++counters_.events;
  return event;
}

std::optional<LogEvent> LogReader::FindEvent() {
  bool damaged = false;
  while (Has(1)) {
    if (auto event = ReadEvent()) return event;
    if (!std::exchange(damaged, true)) ++counters_.damaged_places;
    ++counters_.skipped_bytes;
    ++begin_;
  }
  return std::nullopt;
}

}  // namespace relocd
