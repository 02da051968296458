#include "relocd/instance_lock.h"

#include <errno.h>
#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fmt/format.h>

#include "core/file.h"
#include "core/sha256.h"

namespace relocd {
namespace {

constexpr std::size_t kHashDigits = 12;

/// LCM's networks of two network namespaces do not hear each other.
std::string NetworkId(const std::string& control_url) {
  struct stat network {};
  const bool is_known = ::stat("/proc/self/ns/net", &network) == 0;
  const std::string network_namespace = is_known ? std::to_string(network.st_ino) : "";
  return Sha256Hex(network_namespace + " " + control_url).substr(0, kHashDigits);
}

}  // namespace

Result<InstanceLock> InstanceLock::Take(const std::string& directory,
                                        const std::string& control_url) {
  const std::string path =
      fmt::format("{}/relocd-{}-{}.lock", directory, ::getuid(), NetworkId(control_url));
  UniqueFd fd(::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600));
  if (!fd.valid()) return SystemError(ErrorKind::kUnavailable, "opening " + path);
  if (::flock(fd.get(), LOCK_EX | LOCK_NB) != 0) {
    if (errno != EWOULDBLOCK) return SystemError(ErrorKind::kUnavailable, "locking " + path);
    const auto holder = ReadFile(path);
    const std::string pid = holder ? *holder : "unknown";
    return Error{ErrorKind::kUnavailable,
                 fmt::format("another relocd (pid {}) runs on {}: stop it first (kill {}), or use "
                             "another network (--lcm-url, --image-lcm-url)",
                             pid,
                             control_url,
                             pid)};
  }
  const std::string pid = std::to_string(::getpid());
  if (::ftruncate(fd.get(), 0) != 0 ||
      ::write(fd.get(), pid.data(), pid.size()) != static_cast<ssize_t>(pid.size())) {
    return SystemError(ErrorKind::kUnavailable, "writing " + path);
  }
  return InstanceLock(std::move(fd));
}

}  // namespace relocd
