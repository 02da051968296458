#pragma once

#include <string>
#include <utility>

#include "core/result.h"
#include "core/unique_fd.h"

namespace relocd {

/// Held by the one relocd of a control network on this machine: two would start every daemon twice.
/// Freed by the kernel when the process ends, however it ends.
class InstanceLock {
 public:
  /// The file's name says which network (and which network namespace) it is for.
  ///
  /// @param directory  as in /run/relocd.
  /// @return kUnavailable when another process holds it (naming its pid), or the file cannot be
  /// made.
  static Result<InstanceLock> Take(const std::string& directory, const std::string& control_url);

 private:
  explicit InstanceLock(UniqueFd fd) : fd_(std::move(fd)) {}

  UniqueFd fd_;
};

}  // namespace relocd
