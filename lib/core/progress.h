#pragma once

#include <functional>

namespace relocd {

/// Called after each step of work that may take long, so that whoever waits for it can tell slow
/// work from work that hangs.
using Progress = std::function<void()>;

/// For work that nobody waits for.
inline void Unwatched() {}

}  // namespace relocd
