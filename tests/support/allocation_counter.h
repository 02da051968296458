#pragma once

#include <cstdint>

namespace relocd {

/// How often this program has taken memory from the heap, when it is linked with
/// allocation_counter.cc; 0 under a sanitizer, which has a heap of its own. Thread-safe.
std::int64_t AllocationCount();

}  // namespace relocd
