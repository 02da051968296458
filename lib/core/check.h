#pragma once

namespace relocd::internal {

[[noreturn]] void CheckFailed(const char* condition,
                              const char* message,
                              const char* file,
                              int line);

}  // namespace relocd::internal

/// Ends the process if `condition` is false, in every build type.
///
/// For conditions that only a bug in this project can break. What the world can break (a device, a
/// file, a message, a user) is a Result instead.
#define RELOCD_CHECK(condition, message) \
  (static_cast<bool>(condition)          \
       ? static_cast<void>(0)            \
       : ::relocd::internal::CheckFailed(#condition, message, __FILE__, __LINE__))
