#pragma once

#include "core/error.h"

namespace relocd {

/// What every program of ours ends with, so that scripts and the supervisor can tell why.
inline constexpr int kExitOk = 0;
inline constexpr int kExitFailure = 1;  ///< At run time: trying again may help.
inline constexpr int kExitUsage = 2;    ///< The command line is wrong.
inline constexpr int kExitConfig =
    78;  ///< EX_CONFIG: an input is wrong, trying again with the same one fails again.

inline int ExitCode(const Error& error) {
  return error.kind == ErrorKind::kInvalidInput ? kExitConfig : kExitFailure;
}

}  // namespace relocd
