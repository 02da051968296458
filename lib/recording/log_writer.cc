#include "recording/log_writer.h"

#include <errno.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fmt/format.h>

#include "core/file.h"
#include "recording/log_event.h"

namespace relocd {
namespace {

constexpr std::size_t kBufferSize = 1 << 16;

}  // namespace

Result<LogWriter> LogWriter::Create(const std::string& path) {
  UniqueFd fd(::open(path.c_str(),
                     O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC,
                     S_IRUSR | S_IWUSR | S_IRGRP | S_IROTH));
  if (!fd.valid()) {
    return SystemError(ErrorKind::kUnavailable, fmt::format("creating log {}", path));
  }
  return LogWriter(std::move(fd), path);
}

Result<void> LogWriter::Append(std::int64_t timestamp_us,
                               std::string_view channel,
                               std::span<const std::uint8_t> data) {
  log_format::AppendEvent(event_count_, timestamp_us, channel, data, buffer_);
  ++event_count_;
  if (buffer_.size() < kBufferSize) return {};
  return Flush();
}

Result<void> LogWriter::Flush() {
  while (!buffer_.empty()) {
    const ssize_t written = ::write(fd_.get(), buffer_.data(), buffer_.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) {
      return SystemError(ErrorKind::kUnavailable, fmt::format("writing log {}", path_));
    }
    written_bytes_ += written;
    buffer_.erase(0, static_cast<std::size_t>(written));
  }
  return {};
}

UniqueFd LogWriter::DuplicateFd() const {
  return UniqueFd(::fcntl(fd_.get(), F_DUPFD_CLOEXEC, 0));
}

Result<void> LogWriter::Sync() {
  if (auto ok = Flush(); !ok) return ok;
  if (::fdatasync(fd_.get()) != 0) {
    return SystemError(ErrorKind::kUnavailable, fmt::format("syncing log {}", path_));
  }
  return {};
}

}  // namespace relocd
