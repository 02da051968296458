#include "simulation/campus_site.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace relocd {
namespace {

/// Whether the projections of both onto `axis` are apart.
bool AreApartAlong(const Eigen::Vector2d& axis, const SiteRectangle& a, const SiteRectangle& b) {
  const auto reach = [&axis](const SiteRectangle& r) {
    return r.half_size.x() * std::abs(r.along.dot(axis)) +
           r.half_size.y() * std::abs(r.across().dot(axis));
  };
  return std::abs((a.centre - b.centre).dot(axis)) >= reach(a) + reach(b);
}

}  // namespace

bool AreOverlapping(const SiteRectangle& a, const SiteRectangle& b) {
  return !AreApartAlong(a.along, a, b) && !AreApartAlong(a.across(), a, b) &&
         !AreApartAlong(b.along, a, b) && !AreApartAlong(b.across(), a, b);
}

void CampusSite::Place(std::uint32_t mesh,
                       const Eigen::Vector2d& p_W,
                       const Eigen::Vector2d& forward,
                       double above_m,
                       float scale) {
  Eigen::Affine3f X_WM = Eigen::Affine3f::Identity();
  X_WM.translation() = ground_.PointAt(p_W, above_m);
  const Eigen::Vector2f x = forward.normalized().cast<float>();
  X_WM.linear() << x.x(), -x.y(), 0.0F, x.y(), x.x(), 0.0F, 0.0F, 0.0F, 1.0F;
  X_WM.linear() *= scale;
  scene_.instances.push_back({.mesh = mesh, .X_WM = X_WM});
}

std::optional<KerbPlace> CampusSite::BesideStreet(const PlaneLine& street,
                                                  StreetSide side,
                                                  double distance_m,
                                                  double gap_m) const {
  constexpr double kFurthest = kStreetHalfWidth + kBayWidth + 0.8;
  const LinePlace place = PlaceOnLine(street, distance_m);
  const Eigen::Vector2d out =
      side == StreetSide::kLeft ? place.left() : Eigen::Vector2d(-place.left());
  for (double beside = kStreetHalfWidth + gap_m; beside < kFurthest + gap_m; beside += 0.05) {
    const Eigen::Vector2d p_W = place.p_W + beside * out;
    if (field().DistanceAt(p_W) >= gap_m - 0.03) return KerbPlace{p_W, -out, place.forward};
  }
  return std::nullopt;
}

bool CampusSite::IsFree(const SiteRectangle& rectangle, double to_road_m) const {
  // Along the rim, since a street can be narrower than a building.
  constexpr int kSteps = 8;
  for (int i = 0; i <= kSteps; ++i) {
    const double part = 2.0 * i / kSteps - 1.0;
    for (const Eigen::Vector2d& p_W : {rectangle.Corner(part, -1.0),
                                       rectangle.Corner(part, 1.0),
                                       rectangle.Corner(-1.0, part),
                                       rectangle.Corner(1.0, part)}) {
      if (field().DistanceAt(p_W) < to_road_m) return false;
    }
  }
  return std::none_of(taken_.begin(), taken_.end(), [&](const SiteRectangle& taken) {
    return AreOverlapping(rectangle, taken);
  });
}

bool CampusSite::IsFree(const Eigen::Vector2d& p_W, double radius_m, double to_road_m) const {
  const SiteRectangle rectangle{.centre = p_W, .half_size = {radius_m, radius_m}};
  if (field().DistanceAt(p_W) < to_road_m) return false;
  return std::none_of(taken_.begin(), taken_.end(), [&](const SiteRectangle& taken) {
    return AreOverlapping(rectangle, taken);
  });
}

void CampusSite::PlaceFence(std::uint32_t mesh,
                            const Eigen::Vector2d& from,
                            const Eigen::Vector2d& to) {
  constexpr double kSegment = 2.0;
  const double length = (to - from).norm();
  const Eigen::Vector2d forward = (to - from).normalized();
  for (double s = 0.0; s < length - 0.15; s += kSegment) {
    const double part = std::min(1.0, (length - s) / kSegment);
    const Eigen::Vector3f start = ground_.PointAt(from + s * forward);
    const Eigen::Vector3f end = ground_.PointAt(from + (s + part * kSegment) * forward);
    Eigen::Affine3f X_WM = Eigen::Affine3f::Identity();
    X_WM.translation() = start;
    const Eigen::Vector2f x = forward.cast<float>();
    X_WM.linear() << x.x(), -x.y(), 0.0F, x.y(), x.x(), 0.0F, 0.0F, 0.0F, 1.0F;
    X_WM.linear().col(0) = (end - start) / static_cast<float>(kSegment);
    scene_.instances.push_back({.mesh = mesh, .X_WM = X_WM});
  }
}

}  // namespace relocd
