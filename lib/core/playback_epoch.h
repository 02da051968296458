#pragma once

#include "core/time.h"

namespace relocd {

/// When the recordings that are played at once begin: RELOCD_PLAYBACK_EPOCH_NS of the environment
/// (CLOCK_MONOTONIC, ns), which the supervisor sets once for all its children, or else `now`.
///
/// What was recorded t after a recording's `playback_start_s` comes, and is stamped, at this time
/// plus t: so recordings stay aligned, and a child that starts again resumes in the middle.
MonotonicTime PlaybackEpoch(MonotonicTime now);

}  // namespace relocd
