#include "core/check.h"

#include <cstdlib>

#include <fmt/core.h>

namespace relocd::internal {

void CheckFailed(const char* condition, const char* message, const char* file, int line) {
  fmt::print(stderr, "{}:{}: check failed: {} ({})\n", file, line, message, condition);
  std::abort();
}

}  // namespace relocd::internal
