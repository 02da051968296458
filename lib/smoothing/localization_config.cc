#include "smoothing/localization_config.h"

#include <array>
#include <cmath>
#include <string_view>
#include <utility>

#include <fmt/format.h>

namespace relocd {
namespace {

struct PositiveField {
  std::string_view name;
  double value;
};

}  // namespace

Result<void> LocalizationConfig::Validate() const {
  constexpr double kShortestPeriod = 0.1;
  constexpr double kLongestPeriod = 3600.0;
  if (!(state_period_s >= kShortestPeriod && state_period_s <= kLongestPeriod)) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("state_period_s is {}, must be in [0.1, 3600]", state_period_s)};
  }
  const std::array<PositiveField, 3> fields{{{"state_max_age_s", state_max_age_s},
                                             {"max_speed_mps", max_speed_mps},
                                             {"max_yaw_rate_radps", max_yaw_rate_radps}}};
  for (const PositiveField& field : fields) {
    if (field.value > 0.0 && std::isfinite(field.value)) continue;
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("{} is {}, must be > 0 and finite", field.name, field.value)};
  }
  if (auto ok = smoother.Validate(); !ok) {
    Error error = std::move(ok).error();
    error.message = "smoother." + error.message;
    return error;
  }
  return {};
}

}  // namespace relocd
