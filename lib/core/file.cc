#include "core/file.h"

#include <errno.h>
#include <fcntl.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "core/unique_fd.h"

namespace relocd {
namespace {

Result<void> WriteAll(int fd, std::string_view bytes, const std::string& path) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(fd, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) {
      return SystemError(ErrorKind::kUnavailable, fmt::format("writing {}", path));
    }
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
  return {};
}

/// Creates the file, or empties it.
Result<UniqueFd> OpenToWrite(const std::string& path) {
  UniqueFd fd(::open(path.c_str(),
                     O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC,
                     S_IRUSR | S_IWUSR | S_IRGRP | S_IROTH));
  if (!fd.valid()) return SystemError(ErrorKind::kUnavailable, fmt::format("opening {}", path));
  return fd;
}

/// Makes a rename durable. Best effort: some file systems do not sync folders.
void SyncFolderOf(const std::string& path) {
  const auto folder = std::filesystem::path(path).parent_path();
  const UniqueFd fd(
      ::open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (fd.valid()) ::fsync(fd.get());
}

/// Writes beside the file, and renames.
Result<void> ReplaceFile(const std::string& path, std::string_view bytes) {
  const std::string temporary = fmt::format("{}.tmp.{}", path, ::getpid());
  const auto write = [&]() -> Result<void> {
    const auto fd = OpenToWrite(temporary);
    if (!fd) return fd.error();
    if (auto ok = WriteAll(fd->get(), bytes, temporary); !ok) return ok;
    if (::fsync(fd->get()) != 0) {
      return SystemError(ErrorKind::kUnavailable, fmt::format("syncing {}", temporary));
    }
    if (::rename(temporary.c_str(), path.c_str()) != 0) {
      return SystemError(ErrorKind::kUnavailable,
                         fmt::format("renaming {} to {}", temporary, path));
    }
    return {};
  };
  auto ok = write();
  if (!ok) {
    ::unlink(temporary.c_str());
    return ok;
  }
  SyncFolderOf(path);
  return {};
}

}  // namespace

Error SystemError(ErrorKind kind, std::string_view doing) {
  const int error = errno;
  return {kind, fmt::format("{}: {}", doing, std::generic_category().message(error))};
}

Result<std::string> ReadFile(const std::string& path, const Progress& progress) {
  const UniqueFd fd(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (!fd.valid()) return SystemError(ErrorKind::kUnavailable, fmt::format("opening {}", path));
  std::string content;
  std::string chunk(std::size_t{1} << 16, '\0');
  while (true) {
    const ssize_t size = ::read(fd.get(), chunk.data(), chunk.size());
    if (size < 0 && errno == EINTR) continue;
    if (size < 0) return SystemError(ErrorKind::kUnavailable, fmt::format("reading {}", path));
    if (size == 0) return content;
    content.append(chunk, 0, static_cast<std::size_t>(size));
    progress();
  }
}

Result<void> WriteFile(const std::string& path, std::string_view bytes) {
  const auto fd = OpenToWrite(path);
  if (!fd) return fd.error();
  return WriteAll(fd->get(), bytes, path);
}

Result<void> WriteFileAtomically(const std::string& path, std::string_view bytes) {
  std::error_code error;
  const auto type = std::filesystem::status(path, error).type();
  using std::filesystem::file_type;
  if (type != file_type::regular && type != file_type::not_found) return WriteFile(path, bytes);
  if (!std::filesystem::is_symlink(path, error)) return ReplaceFile(path, bytes);
  const auto target = std::filesystem::weakly_canonical(path, error);
  return ReplaceFile(error ? path : target.string(), bytes);
}

}  // namespace relocd
