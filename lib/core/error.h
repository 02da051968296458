#pragma once

#include <string>
#include <string_view>
#include <utility>

namespace relocd {

/// What the caller can do about a failure, which is all that a caller ever branches on.
enum class ErrorKind {
  kInvalidInput,  ///< Asking again with the same input fails again: a bad config, a corrupt file.
  kUnavailable,   ///< Asking again later may succeed: an unplugged camera, a bus that is down.
  kInternal,      ///< Neither of the two: a bug, or a system call that should not have failed.
};

/// Why something could not be done, in words an operator can act on.
///
/// The message reads `<what was being done>: <what is wrong>`, and names the offending value and
/// what would have been allowed, for example
/// `config/robot.yaml: camera.frame_rate_hz is 0, must be in [1, 120]`.
struct [[nodiscard]] Error {
  ErrorKind kind = ErrorKind::kInternal;
  std::string message;

  /// The same error, with what the caller was doing put before it.
  Error WithContext(std::string_view doing) && {
    return {kind, std::string(doing) + ": " + std::move(message)};
  }
};

}  // namespace relocd
