#include "relocalization/inference_config.h"

#include <fmt/format.h>

namespace relocd {

Result<void> InferenceConfig::Validate() const {
  if (threads < 1 || threads > 64) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("threads is {}, must be in [1, 64]", threads)};
  }
  if (regions_per_image < 2 || regions_per_image > 1000) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("regions_per_image is {}, must be in [2, 1000]", regions_per_image)};
  }
  if (max_image_age_ms < 0 || max_image_age_ms > 60000) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("max_image_age_ms is {}, must be in [0, 60000]", max_image_age_ms)};
  }
  if (auto ok = pose.Validate(); !ok) {
    return Error{ErrorKind::kInvalidInput, "pose." + ok.error().message};
  }
  return {};
}

}  // namespace relocd
