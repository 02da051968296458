#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace relocd {

/// The candidate with the fewest inserted, removed, replaced or swapped letters between it and
/// `name`, for a message such as "did you mean ...?"; empty when none is near.
std::string NearestName(std::string_view name, const std::vector<std::string>& candidates);

}  // namespace relocd
