#pragma once

namespace relocd {

/// Whether sanitizers slow this build down, by twenty times and more where Eigen is not inlined:
/// tests of statistics then take fewer draws or skip. What they run is covered by others.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr bool kIsSlowBuild = true;
#else
inline constexpr bool kIsSlowBuild = false;
#endif

}  // namespace relocd
