#include "smoothing/consensus.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Geometry>

#include "geometry/angle.h"

namespace relocd {
namespace {

/// Nearer pairs than this say too little about the direction: two sigmas that err against each
/// other turn it by more than a radian.
constexpr double kBaselineSigmas = 1.15;
constexpr int kRefinements = 15;
/// Keeps the refinement's system regular where the fixes leave a direction open.
constexpr double kDamping = 1e-9;

double SquaredError(const ConsensusFix& fix, const Pose2& X_WB) {
  const double distance = (X_WB.translation() - fix.X_WB.translation()).norm() / fix.sigma_m;
  double squared = distance * distance;
  if (fix.has_heading) {
    const double turn = WrapAngle(X_WB.yaw() - fix.X_WB.yaw()) / fix.heading_sigma_rad;
    squared += turn * turn;
  }
  return squared;
}

/// The cost of X_WO, or `limit` as soon as it is reached.
double CauchyCost(std::span<const ConsensusFix> fixes, const Pose2& X_WO, double limit) {
  double cost = 0.0;
  for (const ConsensusFix& fix : fixes) {
    cost += std::log1p(SquaredError(fix, X_WO * fix.X_OB));
    if (cost >= limit) return limit;
  }
  return cost;
}

/// The X_WO that puts a's position where it was measured, and b's in the direction measured.
std::optional<Pose2> FromPair(const ConsensusFix& a, const ConsensusFix& b) {
  const Eigen::Vector2d p_ab_O = b.X_OB.translation() - a.X_OB.translation();
  const Eigen::Vector2d p_ab_W = b.X_WB.translation() - a.X_WB.translation();
  const double shortest = kBaselineSigmas * std::max(a.sigma_m, b.sigma_m);
  if (p_ab_O.norm() < shortest || p_ab_W.norm() < shortest) return std::nullopt;
  const double yaw_WO = std::atan2(p_ab_W.y(), p_ab_W.x()) - std::atan2(p_ab_O.y(), p_ab_O.x());
  const Eigen::Vector2d middle_O = 0.5 * (a.X_OB.translation() + b.X_OB.translation());
  const Eigen::Vector2d middle_W = 0.5 * (a.X_WB.translation() + b.X_WB.translation());
  const Eigen::Vector2d p_WO = middle_W - Eigen::Rotation2Dd(yaw_WO) * middle_O;
  return Pose2(p_WO.x(), p_WO.y(), yaw_WO);
}

/// The normal equations of the reweighted fixes in (x, y, yaw) of X_WO, rotated about W's origin
/// of the first fix so that metres and radians stay comparable far from O.
struct NormalEquations {
  Eigen::Matrix3d hessian = Eigen::Matrix3d::Zero();
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
};

NormalEquations Linearize(std::span<const ConsensusFix> fixes,
                          const Pose2& X_WO,
                          const Eigen::Vector2d& pivot_W) {
  NormalEquations equations;
  for (const ConsensusFix& fix : fixes) {
    const Pose2 X_WB = X_WO * fix.X_OB;
    const double weight = 1.0 / (1.0 + SquaredError(fix, X_WB));
    const Eigen::Vector2d arm = X_WB.translation() - pivot_W;
    Eigen::Matrix<double, 2, 3> jacobian;
    jacobian << 1.0, 0.0, -arm.y(), 0.0, 1.0, arm.x();
    const double information = weight / (fix.sigma_m * fix.sigma_m);
    equations.hessian += information * jacobian.transpose() * jacobian;
    equations.gradient +=
        information * jacobian.transpose() * (X_WB.translation() - fix.X_WB.translation());
    if (!fix.has_heading) continue;
    const double heading_information = weight / (fix.heading_sigma_rad * fix.heading_sigma_rad);
    equations.hessian(2, 2) += heading_information;
    equations.gradient(2) += heading_information * WrapAngle(X_WB.yaw() - fix.X_WB.yaw());
  }
  equations.hessian.diagonal().array() += kDamping;
  return equations;
}

/// Moves X_WO to the nearest minimum of the Cauchy cost by reweighted least squares.
Consensus Refine(std::span<const ConsensusFix> fixes, Pose2 X_WO) {
  Consensus result;
  for (int iteration = 0; iteration < kRefinements; ++iteration) {
    const Eigen::Vector2d pivot_W = X_WO * fixes.front().X_OB.translation();
    const NormalEquations equations = Linearize(fixes, X_WO, pivot_W);
    const Eigen::Matrix3d covariance = equations.hessian.inverse();
    const Eigen::Vector3d step = -covariance * equations.gradient;
    const Pose2 about_pivot(step.x(), step.y(), step.z());
    const Eigen::Vector2d p_WO =
        pivot_W + about_pivot * Eigen::Vector2d(X_WO.translation() - pivot_W);
    const Pose2 moved(p_WO.x(), p_WO.y(), X_WO.yaw() + step.z());
    if (!p_WO.allFinite() || !std::isfinite(moved.yaw())) break;
    X_WO = moved;
    result.heading_sigma_rad = std::sqrt(covariance(2, 2));
  }
  result.X_WO = X_WO;
  return result;
}

/// Keeps the cheapest proposal.
class BestProposal {
 public:
  explicit BestProposal(std::span<const ConsensusFix> fixes) : fixes_(fixes) {}

  void Consider(const Pose2& X_WO) {
    const double cost = CauchyCost(fixes_, X_WO, cost_);
    if (cost >= cost_) return;
    cost_ = cost;
    X_WO_ = X_WO;
  }
  [[nodiscard]] bool has_value() const { return std::isfinite(cost_); }
  [[nodiscard]] const Pose2& X_WO() const { return X_WO_; }

 private:
  std::span<const ConsensusFix> fixes_;
  double cost_ = std::numeric_limits<double>::infinity();
  Pose2 X_WO_;
};

}  // namespace

ConsensusFix ToConsensusFix(const Fix& fix, const Pose2& X_OB) {
  ConsensusFix result;
  result.X_OB = X_OB;
  result.X_WB = fix.X_WB;
  result.has_heading = fix.has_heading;
  result.sigma_m = std::sqrt(0.5 * fix.covariance.topLeftCorner<2, 2>().trace());
  if (fix.has_heading) result.heading_sigma_rad = std::sqrt(fix.covariance(2, 2));
  return result;
}

bool Supports(const ConsensusFix& fix, const Pose2& X_WB, const ConsensusOptions& options) {
  const double radius_m = std::max(options.radius_sigmas * fix.sigma_m, options.min_radius_m);
  if ((X_WB.translation() - fix.X_WB.translation()).norm() > radius_m) return false;
  if (!fix.has_heading) return true;
  // A wrong place with the right heading is likely on a straight road; a wrong heading at the right
  // place is not.
  constexpr double kLeastTurn = 0.1;
  const double turn = std::abs(WrapAngle(X_WB.yaw() - fix.X_WB.yaw()));
  return turn <= std::max(options.radius_sigmas * fix.heading_sigma_rad, kLeastTurn);
}

int CountSupporters(std::span<const ConsensusFix> fixes,
                    const Pose2& X_WO,
                    const ConsensusOptions& options) {
  return static_cast<int>(std::count_if(fixes.begin(), fixes.end(), [&](const ConsensusFix& fix) {
    return Supports(fix, X_WO * fix.X_OB, options);
  }));
}

std::optional<Consensus> FindConsensus(std::span<const ConsensusFix> fixes,
                                       const ConsensusOptions& options) {
  BestProposal best(fixes);
  for (std::size_t i = 0; i < fixes.size(); ++i) {
    if (fixes[i].has_heading) {
      best.Consider(fixes[i].X_WB * fixes[i].X_OB.Inverse());
      continue;
    }
    for (std::size_t j = i + 1; j < fixes.size(); ++j) {
      if (const auto X_WO = FromPair(fixes[i], fixes[j])) best.Consider(*X_WO);
    }
  }
  if (!best.has_value()) return std::nullopt;
  Consensus consensus = Refine(fixes, best.X_WO());
  consensus.supporters = CountSupporters(fixes, consensus.X_WO, options);
  return consensus;
}

}  // namespace relocd
