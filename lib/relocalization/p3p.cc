#include "relocalization/p3p.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include <Eigen/Geometry>
#include <Eigen/LU>

namespace relocd {
namespace {

/// Sine of the angle below which two sides of the triangle, or two rays, count as one direction.
constexpr double kMinSine = 1e-6;

/// The triangle's squared sides, in units of their sum, and the cosines between the rays. Names as
/// in Lambda Twist: a_ij = |x_i - x_j|^2 and b_ij = y_i . y_j, and the depths obey
/// `l_i^2 + l_j^2 - 2 b_ij l_i l_j = a_ij`.
struct Triangle {
  double a12 = 0.0;
  double a13 = 0.0;
  double a23 = 0.0;
  double b12 = 0.0;
  double b13 = 0.0;
  double b23 = 0.0;

  [[nodiscard]] Eigen::Vector3d Residual(const Eigen::Vector3d& l) const {
    return {l[0] * l[0] + l[1] * l[1] - 2.0 * b12 * l[0] * l[1] - a12,
            l[0] * l[0] + l[2] * l[2] - 2.0 * b13 * l[0] * l[2] - a13,
            l[1] * l[1] + l[2] * l[2] - 2.0 * b23 * l[1] * l[2] - a23};
  }
};

/// The root of x^3 + b x^2 + c x + d that is simple and where the slope is steep: the outer one on
/// the side of the stationary point that the root is separated by.
double CubicRoot(double b, double c, double d) {
  const auto value = [&](double x) { return ((x + b) * x + c) * x + d; };
  double x = -b / 3.0;
  const double discriminant = b * b - 3.0 * c;
  if (discriminant > 0.0) {
    // Beyond a stationary point the cubic is bent one way, so that Newton cannot overshoot.
    const double step = std::sqrt(discriminant) / 3.0;
    const double stationary = value(x - step) > 0.0 ? x - step : x + step;
    const double half_bend = 3.0 * stationary + b;  // nonzero: +-sqrt(discriminant)
    const double offset = std::sqrt(std::max(0.0, -value(stationary) / half_bend));
    x = half_bend < 0.0 ? stationary - offset : stationary + offset;
  } else if (discriminant > -1e-3 * b * b) {
    // An almost level inflection: start where the slope is not.
    x += std::cbrt(-value(x));
  }
  constexpr int kMaxSteps = 30;
  for (int i = 0; i < kMaxSteps; ++i) {
    const double slope = (3.0 * x + 2.0 * b) * x + c;
    if (slope == 0.0) break;
    const double step = value(x) / slope;
    x -= step;
    if (std::abs(step) <= 1e-12 * std::abs(x)) break;
  }
  return x;
}

/// det(A + g B) = d0 + d1 g + d2 g^2 + d3 g^3.
struct PencilDeterminant {
  double d0 = 0.0;
  double d1 = 0.0;
  double d2 = 0.0;
  double d3 = 0.0;
};

PencilDeterminant DeterminantOfPencil(const Eigen::Matrix3d& A, const Eigen::Matrix3d& B) {
  const Eigen::Vector3d a23 = A.col(1).cross(A.col(2));
  const Eigen::Vector3d a31 = A.col(2).cross(A.col(0));
  const Eigen::Vector3d a12 = A.col(0).cross(A.col(1));
  const Eigen::Vector3d b23 = B.col(1).cross(B.col(2));
  const Eigen::Vector3d b31 = B.col(2).cross(B.col(0));
  const Eigen::Vector3d b12 = B.col(0).cross(B.col(1));
  return {.d0 = A.col(0).dot(a23),
          .d1 = B.col(0).dot(a23) + B.col(1).dot(a31) + B.col(2).dot(a12),
          .d2 = A.col(0).dot(b23) + A.col(1).dot(b31) + A.col(2).dot(b12),
          .d3 = B.col(0).dot(b23)};
}

/// A degenerate conic of a pencil, and a regular one that meets it in the same points.
struct ConicPair {
  Eigen::Matrix3d degenerate;
  Eigen::Matrix3d regular;
};

ConicPair SplitPencil(const Eigen::Matrix3d& A, const Eigen::Matrix3d& B) {
  const PencilDeterminant det = DeterminantOfPencil(A, B);
  if (std::abs(det.d3) < std::abs(det.d0)) return SplitPencil(B, A);
  // Both are line pairs already, as from straight above an equilateral triangle.
  if (std::abs(det.d3) < 1e-14 * (std::abs(det.d1) + std::abs(det.d2))) return {A, B};
  const double g = CubicRoot(det.d2 / det.d3, det.d1 / det.d3, det.d0 / det.d3);
  // On the lines A = -g B: the smaller of the two there would be rounding alone.
  return {.degenerate = A + g * B, .regular = std::abs(g) < 1.0 ? B : A};
}

/// The two lines g, h of a degenerate conic C = g h^T + h g^T, as columns; nothing when they are
/// not real.
std::optional<Eigen::Matrix<double, 3, 2>> SplitIntoLines(const Eigen::Matrix3d& C) {
  // adj(C) = -(g x h)(g x h)^T, and C -+ Skew(g x h) is twice g h^T or h g^T.
  Eigen::Matrix3d adjugate;
  adjugate.col(0) = C.col(1).cross(C.col(2));
  adjugate.col(1) = C.col(2).cross(C.col(0));
  adjugate.col(2) = C.col(0).cross(C.col(1));
  Eigen::Index i = 0;
  const double square = -adjugate.diagonal().minCoeff(&i);
  Eigen::Matrix3d N = C;
  if (square > 0.0) {
    const Eigen::Vector3d p = adjugate.col(i) / std::sqrt(square);
    N(0, 1) -= p.z();
    N(0, 2) += p.y();
    N(1, 0) += p.z();
    N(1, 2) -= p.x();
    N(2, 0) -= p.y();
    N(2, 1) += p.x();
  } else if (adjugate.diagonal().maxCoeff() > 1e-12 * C.squaredNorm()) {
    return std::nullopt;
  }
  Eigen::Index row = 0;
  Eigen::Index column = 0;
  N.cwiseAbs().maxCoeff(&row, &column);
  Eigen::Matrix<double, 3, 2> lines;
  lines.col(0) = N.row(row).transpose();
  lines.col(1) = N.col(column);
  return lines;
}

/// Where a line meets a conic with all three coordinates positive: up to two points.
struct Intersections {
  std::array<Eigen::Vector3d, 2> depths;
  int count = 0;
};

Intersections Intersect(const Eigen::Vector3d& line, const Eigen::Matrix3d& conic) {
  Eigen::Index k = 0;
  line.cwiseAbs().maxCoeff(&k);
  const Eigen::Index i = (k + 1) % 3;
  const Eigen::Index j = (k + 2) % 3;
  Eigen::Vector3d from_i = Eigen::Vector3d::Unit(i);
  Eigen::Vector3d from_j = Eigen::Vector3d::Unit(j);
  from_i[k] = -line[i] / line[k];
  from_j[k] = -line[j] / line[k];

  // depths = from_i + ratio * from_j, put into the conic.
  const double c = from_i.dot(conic * from_i);
  const double b = from_i.dot(conic * from_j);
  const double a = from_j.dot(conic * from_j);
  double discriminant = b * b - a * c;
  if (discriminant < 0.0) {
    // A tangent, up to rounding: the polish decides.
    if (discriminant < -1e-8 * (b * b + std::abs(a * c))) return {};
    discriminant = 0.0;
  }
  const double q = -(b + std::copysign(std::sqrt(discriminant), b));
  Intersections found;
  for (const double ratio : {q / a, c / q}) {
    const Eigen::Vector3d depths = from_i + ratio * from_j;
    if (!(ratio > 0.0) || !(depths[k] > 0.0) || !std::isfinite(ratio)) continue;
    found.depths[static_cast<std::size_t>(found.count++)] = depths;
  }
  return found;
}

/// Newton steps on the three quadrics. @return false where they lead to no positive solution.
bool Polish(const Triangle& triangle, Eigen::Vector3d& l) {
  constexpr int kMaxSteps = 5;
  constexpr double kTolerance = 1e-12;  // of equations whose right sides add up to 1
  Eigen::Vector3d residual = triangle.Residual(l);
  for (int i = 0; i < kMaxSteps && residual.cwiseAbs().maxCoeff() > kTolerance; ++i) {
    Eigen::Matrix3d J;  // half of it, as of the residual below
    J << l[0] - triangle.b12 * l[1], l[1] - triangle.b12 * l[0], 0.0,  //
        l[0] - triangle.b13 * l[2], 0.0, l[2] - triangle.b13 * l[0],   //
        0.0, l[1] - triangle.b23 * l[2], l[2] - triangle.b23 * l[1];
    const Eigen::Vector3d moved = l - J.inverse() * (0.5 * residual);
    const Eigen::Vector3d moved_residual = triangle.Residual(moved);
    if (!(moved_residual.squaredNorm() < residual.squaredNorm())) break;
    l = moved;
    residual = moved_residual;
  }
  constexpr double kAccepted = 1e-7;
  return residual.cwiseAbs().maxCoeff() < kAccepted && l.minCoeff() > 0.0;
}

/// The orthonormal frame that two sides of a triangle span, one axis a column.
Eigen::Matrix3d FrameOf(const Eigen::Vector3d& side, const Eigen::Vector3d& other_side) {
  Eigen::Matrix3d frame;
  frame.col(0) = side.normalized();
  frame.col(2) = side.cross(other_side).normalized();
  frame.col(1) = frame.col(2).cross(frame.col(0));
  return frame;
}

}  // namespace

P3pSolutions SolveP3p(const Eigen::Matrix3d& rays_C, const Eigen::Matrix3d& p_WPs) {
  const Eigen::Vector3d side12 = p_WPs.col(1) - p_WPs.col(0);
  const Eigen::Vector3d side13 = p_WPs.col(2) - p_WPs.col(0);
  const Eigen::Vector3d side23 = p_WPs.col(2) - p_WPs.col(1);
  Triangle triangle{.a12 = side12.squaredNorm(),
                    .a13 = side13.squaredNorm(),
                    .a23 = side23.squaredNorm(),
                    .b12 = rays_C.col(0).dot(rays_C.col(1)),
                    .b13 = rays_C.col(0).dot(rays_C.col(2)),
                    .b23 = rays_C.col(1).dot(rays_C.col(2))};
  const double sum = triangle.a12 + triangle.a13 + triangle.a23;
  P3pSolutions solutions;
  // Comparisons that NaN fails; the sum of squares may overflow.
  constexpr double kMaxCosine = 1.0 - 0.5 * kMinSine * kMinSine;
  const bool is_triangle = side12.cross(side13).norm() > kMinSine * sum && sum < HUGE_VAL;
  const bool is_cone = triangle.b12 < kMaxCosine && triangle.b13 < kMaxCosine &&
                       triangle.b23 < kMaxCosine && std::isfinite(rays_C.sum());
  if (!is_triangle || !is_cone) {
    solutions.degenerate = true;
    return solutions;
  }
  triangle.a12 /= sum;
  triangle.a13 /= sum;
  triangle.a23 /= sum;

  Eigen::Matrix3d D1;
  D1 << triangle.a23, -triangle.a23 * triangle.b12, 0.0,  //
      -triangle.a23 * triangle.b12, triangle.a23 - triangle.a12, triangle.a12 * triangle.b23, 0.0,
      triangle.a12 * triangle.b23, -triangle.a12;
  Eigen::Matrix3d D2;
  D2 << triangle.a23, 0.0, -triangle.a23 * triangle.b13,  //
      0.0, -triangle.a13, triangle.a13 * triangle.b23,    //
      -triangle.a23 * triangle.b13, triangle.a13 * triangle.b23, triangle.a23 - triangle.a13;
  const ConicPair conics = SplitPencil(D1, D2);
  const std::optional<Eigen::Matrix<double, 3, 2>> lines = SplitIntoLines(conics.degenerate);
  if (!lines) return solutions;

  const double scale = std::sqrt(sum);
  const Eigen::Matrix3d frame_W = FrameOf(side12, side13);
  for (Eigen::Index line = 0; line < 2; ++line) {
    const Intersections found = Intersect(lines->col(line), conics.regular);
    for (int i = 0; i < found.count; ++i) {
      Eigen::Vector3d l = found.depths[static_cast<std::size_t>(i)];
      const double size = (triangle.Residual(l).sum() + 1.0);  // the same equations, added
      if (!(size > 0.0)) continue;
      l /= std::sqrt(size);
      if (!Polish(triangle, l)) continue;
      const Eigen::Matrix3d p_CPs = rays_C * (scale * l).asDiagonal();
      CameraFromWorld solution;
      solution.R_CW =
          FrameOf(p_CPs.col(1) - p_CPs.col(0), p_CPs.col(2) - p_CPs.col(0)) * frame_W.transpose();
      solution.p_CW = p_CPs.col(0) - solution.R_CW * p_WPs.col(0);
      solutions.Add(solution);
    }
  }
  return solutions;
}

}  // namespace relocd
