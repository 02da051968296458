#include "runtime/start_extension.h"

namespace relocd {

void StartExtension::Step(MonotonicTime now) {
  constexpr int kTold = 10;
  if (now < next_) return;
  next_ = now + timeout_ / kTold;
  manager_.ExtendTimeout(timeout_);
}

}  // namespace relocd
