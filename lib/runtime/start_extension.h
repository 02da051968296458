#pragma once

#include "core/time.h"
#include "runtime/service_manager.h"

namespace relocd {

/// Gives a slow start time for as long as it makes progress: each step of it may take the manager's
/// whole start timeout again. A start that hangs makes no steps, and is ended.
///
/// Borrows the manager, which must outlive it. Thread-bound.
class StartExtension {
 public:
  StartExtension(ServiceManager& manager, Duration timeout)
      : manager_(manager), timeout_(timeout) {}

  /// A step was done. Steps may be as small as they like: the manager hears of ten in a timeout.
  void Step(MonotonicTime now);

 private:
  ServiceManager& manager_;
  Duration timeout_;
  MonotonicTime next_{};  ///< When the manager is told again.
};

}  // namespace relocd
