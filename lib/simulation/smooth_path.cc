#include "simulation/smooth_path.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "core/check.h"
#include "geometry/angle.h"

namespace relocd {
namespace {

constexpr std::size_t kLeastControls = 4;
/// The speed along a span of the spline is smooth: this fine, five points of Gauss's rule give its
/// length to rounding.
constexpr int kPiecesPerSpan = 4;

struct GaussPoint {
  double place = 0.0;   ///< In [-1, 1].
  double weight = 0.0;  ///< They add up to 2.
};
constexpr std::array<GaussPoint, 5> kGauss{{{0.0, 0.5688888888888889},
                                            {0.5384693101056831, 0.4786286704993665},
                                            {-0.5384693101056831, 0.4786286704993665},
                                            {0.9061798459386640, 0.2369268850561891},
                                            {-0.9061798459386640, 0.2369268850561891}}};

}  // namespace

SmoothPath::SmoothPath(std::vector<Eigen::Vector2d> controls) : controls_(std::move(controls)) {
  RELOCD_CHECK(controls_.size() >= kLeastControls, "a cubic spline has at least four controls");
  const std::size_t spans = controls_.size() - kLeastControls + 1;
  const std::size_t count = spans * kPiecesPerSpan;
  double end_m = 0.0;
  double heading_rad = 0.0;
  for (std::size_t i = 0; i < count; ++i) {
    Piece piece{.begin = static_cast<double>(i) / kPiecesPerSpan,
                .end = static_cast<double>(i + 1) / kPiecesPerSpan};
    const Eigen::Vector2d direction = Evaluate(piece.begin).first;
    heading_rad += WrapAngle(std::atan2(direction.y(), direction.x()) - heading_rad);
    piece.heading_rad = heading_rad;
    piece.begin_m = end_m;
    end_m += LengthBetween(piece.begin, piece.end);
    piece.end_m = end_m;
    pieces_.push_back(piece);
  }
}

SmoothPath::Derivatives SmoothPath::Evaluate(double control) const {
  const auto last_span = static_cast<double>(controls_.size() - kLeastControls);
  const double span = std::clamp(std::floor(control), 0.0, last_span);
  const double u = control - span;
  const auto first = static_cast<std::size_t>(span);
  const Eigen::Vector2d& a = controls_[first];
  const Eigen::Vector2d& b = controls_[first + 1];
  const Eigen::Vector2d& c = controls_[first + 2];
  const Eigen::Vector2d& d = controls_[first + 3];
  // The coefficients of the polynomial of a uniform cubic B-spline, times 6.
  const Eigen::Vector2d p0 = a + 4.0 * b + c;
  const Eigen::Vector2d p1 = 3.0 * (c - a);
  const Eigen::Vector2d p2 = 3.0 * (a - 2.0 * b + c);
  const Eigen::Vector2d p3 = d - a + 3.0 * (b - c);
  return {.value = (p0 + u * (p1 + u * (p2 + u * p3))) / 6.0,
          .first = (p1 + u * (2.0 * p2 + 3.0 * u * p3)) / 6.0,
          .second = (2.0 * p2 + 6.0 * u * p3) / 6.0};
}

double SmoothPath::LengthBetween(double begin, double end) const {
  const double half = 0.5 * (end - begin);
  const double middle = 0.5 * (end + begin);
  double length_m = 0.0;
  for (const GaussPoint& point : kGauss)
    length_m += half * point.weight * Evaluate(middle + half * point.place).first.norm();
  return length_m;
}

double SmoothPath::ControlAt(const Piece& piece, double distance_m) const {
  const double part = (distance_m - piece.begin_m) / (piece.end_m - piece.begin_m);
  double control = piece.begin + part * (piece.end - piece.begin);
  // Newton's method doubles the digits each time, and begins with two.
  constexpr int kIterations = 4;
  for (int i = 0; i < kIterations; ++i) {
    const double error_m = piece.begin_m + LengthBetween(piece.begin, control) - distance_m;
    control -= error_m / Evaluate(control).first.norm();
  }
  return control;
}

SmoothPath::Point SmoothPath::At(double distance_m) const {
  distance_m = std::clamp(distance_m, 0.0, length_m());
  const auto after = std::upper_bound(
      pieces_.begin(), pieces_.end() - 1, distance_m, [](double distance, const Piece& piece) {
        return distance < piece.end_m;
      });
  const Derivatives at = Evaluate(ControlAt(*after, distance_m));
  const double speed = at.first.norm();
  const double cross = at.first.x() * at.second.y() - at.first.y() * at.second.x();
  const double turn_rad = WrapAngle(std::atan2(at.first.y(), at.first.x()) - after->heading_rad);
  return {.p_W = at.value,
          .heading_rad = after->heading_rad + turn_rad,
          .curvature_per_m = cross / (speed * speed * speed)};
}

double SmoothPath::DistanceAt(double control) const {
  control = std::clamp(control, 0.0, pieces_.back().end);
  const auto index =
      std::min(static_cast<std::size_t>(control * kPiecesPerSpan), pieces_.size() - 1);
  const Piece& piece = pieces_[index];
  return piece.begin_m + LengthBetween(piece.begin, control);
}

}  // namespace relocd
