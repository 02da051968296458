#pragma once

#include <cstddef>

namespace relocd {

/// How many correspondences the vectorised loops handle at once. It is fixed, whatever the CPU has,
/// so that sums are added up in one order and come out the same, bit for bit, everywhere.
inline constexpr std::size_t kLanes = 8;

/// kLanes floats, which the compiler maps to the registers there are. The alignment is that of one
/// float, so that they may be read from any place in an array.
using FloatLanes [[gnu::vector_size(kLanes * sizeof(float)), gnu::aligned(4), gnu::may_alias]] =
    float;

/// Before a function: compile it once for any CPU and once for those with AVX2, and choose when the
/// program starts.
#if defined(__x86_64__) && !defined(__clang__)
#define RELOCD_CLONE_FOR_AVX2 __attribute__((target_clones("default", "avx2")))
#else
#define RELOCD_CLONE_FOR_AVX2
#endif

}  // namespace relocd
