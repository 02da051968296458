#pragma once

#include <vector>

#include <Eigen/Core>

#include "core/result.h"

namespace relocd {

/// One run round a square, begun and ended at the same mark.
struct SquareRun {
  bool clockwise = false;
  /// Where the robot truly ended less where odometry has it, in the frame in which it began, along
  /// the first side (x) and to the left (y).
  Eigen::Vector2d error_m = Eigen::Vector2d::Zero();
};

/// Borenstein and Feng, "Measurement and correction of systematic odometry errors in mobile
/// robots", 1996: the University of Michigan benchmark.
struct Umbmark {
  Eigen::Vector2d centre_clockwise_m = Eigen::Vector2d::Zero();  ///< Of gravity of the errors.
  Eigen::Vector2d centre_counter_clockwise_m = Eigen::Vector2d::Zero();
  double largest_error_m = 0.0;  ///< The measure of systematic error, E_max,syst.
  double alpha_rad = 0.0;        ///< How much too little each corner is turned: type A, the track.
  double beta_rad = 0.0;         ///< How much each side is bent: type B, unequal wheels.
  double track_factor = 1.0;     ///< Actual over nominal: E_b.
  double left_scale = 1.0;       ///< To be multiplied to the wheel's travel: c_L.
  double right_scale = 1.0;      ///< The same: c_R.
  Eigen::Vector2d spread_m = Eigen::Vector2d::Zero();  ///< Of the runs about their centres.
  double track_factor_sigma = 0.0;
  double ratio_sigma = 0.0;  ///< Of right_scale / left_scale.
};

/// @param side_m   of the square.
/// @param track_m  as the config has it.
/// @return kInvalidInput without a run in each direction, or for a side or track that is not
///         positive.
Result<Umbmark> EvaluateUmbmark(const std::vector<SquareRun>& runs, double side_m, double track_m);

}  // namespace relocd
