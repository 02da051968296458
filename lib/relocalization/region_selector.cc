#include "relocalization/region_selector.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

#include "core/check.h"
#include "relocalization/training_places.h"

namespace relocd {
namespace {

/// A region knows what is seen from this near its training poses, and looking about as they did.
constexpr double kReachM = 10.0;
constexpr double kReachRad = 1.0;
/// How many standard deviations an expectation may be off.
constexpr double kSigmas = 3.0;

/// How far the prior is from the nearest training pose of a region that looks its way; infinite if
/// there is none within reach.
double Distance(const MapRegion& region, const CameraPrior& prior) {
  const NearestPlace nearest =
      FindNearestPlace(region, prior.X_WC, kReachRad + kSigmas * prior.sigma_rad);
  return nearest.distance_m < kReachM + kSigmas * prior.sigma_m
             ? nearest.distance_m
             : std::numeric_limits<double>::infinity();
}

}  // namespace

RegionSelector::RegionSelector(const std::vector<MapRegion>& regions, std::size_t limit)
    : regions_(regions), limit_(std::min(limit, regions.size())) {
  RELOCD_CHECK(limit >= 2, "one for what is expected, one for the search");
}

std::vector<std::size_t> RegionSelector::Choose(const std::optional<CameraPrior>& prior) {
  std::vector<std::size_t> chosen = prior ? Expected(*prior) : AroundLast();
  const bool search = !last_ || chosen.empty();
  const std::size_t most = search ? std::max<std::size_t>(limit_, 2) - 1 : limit_;
  if (chosen.size() > most) chosen.resize(most);
  if (search) FillInTurn(chosen);
  return chosen;
}

void RegionSelector::Report(std::optional<std::size_t> region) {
  last_ = region;
}

std::vector<std::size_t> RegionSelector::Expected(const CameraPrior& prior) const {
  // Where regions overlap, the one that gave the last pose comes first: no need to try the other.
  using Candidate = std::tuple<double, bool, std::size_t>;
  std::vector<Candidate> candidates;
  for (std::size_t region = 0; region < regions_.size(); ++region) {
    const double distance_m = Distance(regions_[region], prior);
    if (std::isfinite(distance_m)) candidates.emplace_back(distance_m, region != last_, region);
  }
  std::ranges::sort(candidates);
  std::vector<std::size_t> chosen;
  for (const auto& [distance_m, is_other, region] : candidates)
    chosen.push_back(region);
  return chosen;
}

std::vector<std::size_t> RegionSelector::AroundLast() const {
  if (!last_) return {};
  std::vector<std::size_t> chosen{*last_};
  if (*last_ + 1 < regions_.size()) chosen.push_back(*last_ + 1);
  if (*last_ > 0) chosen.push_back(*last_ - 1);
  return chosen;
}

void RegionSelector::FillInTurn(std::vector<std::size_t>& chosen) {
  for (std::size_t tried = 0; tried < regions_.size() && chosen.size() < limit_; ++tried) {
    const std::size_t region = next_in_turn_++ % regions_.size();
    if (std::ranges::find(chosen, region) == chosen.end()) chosen.push_back(region);
  }
}

}  // namespace relocd
