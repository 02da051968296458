#include "core/playback_epoch.h"

#include <cstdlib>
#include <optional>

#include "core/parse_number.h"

namespace relocd {

MonotonicTime PlaybackEpoch(MonotonicTime now) {
  // Read once, before any thread could change the environment.
  const char* text = std::getenv("RELOCD_PLAYBACK_EPOCH_NS");  // NOLINT(concurrency-mt-unsafe)
  const auto epoch_ns = text == nullptr ? std::nullopt : ParseInt64(text);
  return epoch_ns ? FromNanoseconds(*epoch_ns) : now;
}

}  // namespace relocd
