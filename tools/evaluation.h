#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/result.h"
#include "evaluation_input.h"
#include "geometry/pose3.h"
#include "geometry/trajectory_metrics.h"

namespace relocd {

struct EvaluationOptions {
  bool align = false;                       ///< Also the errors after a rigid alignment.
  std::int64_t max_gap_ns = 1'000'000'000;  ///< The truth is not interpolated over longer ones.
};

/// Relative errors over one length of the way, or of time.
struct RelativeSummary {
  std::string over;  ///< "10 m", "1 s".
  std::string translation_unit;
  std::string rotation_unit;
  ErrorSummary translation;
  ErrorSummary rotation;
};

/// How an estimate compares with the truth. In the plane if either file is planar: poses in space
/// are then projected, which takes a world with z up and a body with x forward.
struct Evaluation {
  bool planar = false;
  bool has_heading = false;
  std::vector<EvaluatedPose> truths;     ///< All of the truth, projected where planar.
  std::vector<EvaluatedPose> estimates;  ///< The matched ones; after the alignment if there is one.
  std::vector<PosePair> pairs;           ///< One for each of the matched ones.
  std::size_t outside = 0;               ///< Estimates before the truth begins or after its end.
  std::size_t in_gaps = 0;               ///< Estimates where the truth has a gap.

  ErrorSummary position_m;
  ErrorSummary rotation_deg;
  std::optional<Pose3> alignment;  ///< Was put before each estimate.
  ErrorSummary aligned_position_m;
  ErrorSummary aligned_rotation_deg;
  std::vector<RelativeSummary> relative;
  Coverage coverage;            ///< Before the alignment.
  double median_sigma_m = 0.0;  ///< Of the larger axis of the reported position covariance.

  double truth_length_m = 0.0;  ///< Between the matched times.
  double duration_s = 0.0;      ///< From the first to the last matched time.
};

/// @return kInvalidInput when no estimate has a truth at its time, or the alignment is not
/// determined.
Result<Evaluation> Evaluate(const EvaluatedTrajectory& truth,
                            const EvaluatedTrajectory& estimate,
                            const EvaluationOptions& options);

/// The table that people read.
std::string FormatTable(const Evaluation& evaluation,
                        const EvaluatedTrajectory& truth,
                        const EvaluatedTrajectory& estimate);
/// The same for scripts, in one line.
std::string FormatJson(const Evaluation& evaluation,
                       const EvaluatedTrajectory& truth,
                       const EvaluatedTrajectory& estimate);

/// The parts of that line, which other reports say in the same words.
std::string JsonString(std::string_view text);
std::string JsonSummary(const ErrorSummary& summary);
std::string JsonCoverage(const Evaluation& evaluation);
std::string JsonCounts(const std::map<std::string, std::size_t>& counts);

}  // namespace relocd
