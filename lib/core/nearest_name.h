#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace relocd {

/// The candidate with the fewest inserted, removed, replaced or swapped letters between it and
/// `name`, for a message such as "did you mean ...?"; empty when none is near.
std::string NearestName(std::string_view name, const std::vector<std::string>& candidates);

/// The `count` candidates nearest to `name`, however far, the nearest first.
std::vector<std::string> NearestNames(std::string_view name,
                                      std::vector<std::string> candidates,
                                      std::size_t count);

}  // namespace relocd
