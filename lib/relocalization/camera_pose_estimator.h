#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

#include "camera/pinhole_camera.h"
#include "core/result.h"
#include "geometry/pose3.h"
#include "relocalization/correspondence.h"

namespace relocd {

/// How much a map's scene coordinates can be trusted, measured when the map is built and stored in
/// it. The errors of neighbouring cells are not independent, so that the covariance that the
/// equations give is too small by a factor that only held-out images tell.
struct PoseCalibration {
  double covariance_scale = 1.0;  ///< > 0; of the equations' covariance and the hypotheses' spread.
  double translation_floor_sigma_m = 0.0;  ///< >= 0; added, in squares, to each axis.
  double rotation_floor_sigma_rad = 0.0;   ///< >= 0
  double min_confidence = 0.15;            ///< in [0, 1]; with less support there is no pose.
};

/// How a camera pose is searched.
struct CameraPoseOptions {
  int hypotheses = 32;
  int max_tries = 4000;
  int scored_points = 600;
  int refined_hypotheses = 6;
  int refinement_steps = 12;
  double inlier_threshold_mrad = 15.0;
  double max_sigma_t_m = 20.0;
  double max_sigma_r_rad = 0.3;
  PoseCalibration calibration;  ///< Not for the config: the map brings it.

  template <typename Self, typename Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("hypotheses", self.hypotheses, "in [1, 10000]; poses scored for each image");
    visit("max_tries",
          self.max_tries,
          "in [1, 1000000]; minimal sets drawn for them: bounds the time when nothing fits");
    visit("scored_points",
          self.scored_points,
          "in [4, 100000]; correspondences each hypothesis is scored on before the best go on");
    visit("refined_hypotheses",
          self.refined_hypotheses,
          "in [1, 1000]; hypotheses that are scored on everything and refined");
    visit("refinement_steps", self.refinement_steps, "in [1, 100]; Gauss-Newton steps at the end");
    visit("inlier_threshold_mrad",
          self.inlier_threshold_mrad,
          "in [0.1, 1000]; reprojection error up to which a correspondence supports a pose, as the "
          "angle that it is on the optical axis");
    visit("max_sigma_t_m",
          self.max_sigma_t_m,
          "> 0; a pose whose position is less certain along some axis is none");
    visit("max_sigma_r_rad", self.max_sigma_r_rad, "> 0; the same for its rotation");
  }

  /// @return kInvalidInput, naming the field, its value and what is allowed.
  [[nodiscard]] Result<void> Validate() const;
};

enum class CameraPoseStatus {
  kOk,
  kNoHypothesis,   ///< No minimal set gave a pose that a fourth point agrees with.
  kLowConfidence,  ///< The best pose has too little support.
  kDegenerate,     ///< What supports the best pose does not determine it.
  kOffRoute,       ///< The best pose is far from where the map was learned.
};

/// `ok`, `no_hypothesis`, `low_confidence`, `degenerate`, `off_route`, as in files and logs.
std::string_view Name(CameraPoseStatus status);

struct CameraPoseResult {
  CameraPoseStatus status = CameraPoseStatus::kNoHypothesis;
  Pose3 X_WC;  ///< Only with kOk.
  /// 6x6 of the right perturbation (translation, rotation) of X_WC, m and rad. Only with kOk.
  Matrix6d covariance = Matrix6d::Zero();
  int correspondences = 0;           ///< All that came in, also those that were not usable.
  int inliers = 0;                   ///< With an error below the threshold.
  int hypotheses = 0;                ///< Poses scored.
  double reprojection_rms_px = 0.0;  ///< Of the inliers, in px of the undistorted image.
  double confidence = 0.0;           ///< Soft inlier score as a share of all correspondences.
};

/// The pose of a camera from what its pixels are believed to show: P3P in a preemptive RANSAC,
/// local refinement of the best hypotheses, robust refinement of the best on everything. Minimal
/// sets are drawn from the more confident half of the correspondences.
///
/// The result is a function of the arguments, bit for bit, and the time is bounded by the options.
/// Correspondences that are not finite support nothing, and are otherwise ignored.
///
/// @param camera   of the image that the pixels are in.
/// @param options  valid in the sense of its Validate().
/// @param prior  of X_WC: a pose to try as one more hypothesis: it competes on equal terms.
CameraPoseResult EstimateCameraPose(std::span<const Correspondence> correspondences,
                                    const PinholeCamera& camera,
                                    const CameraPoseOptions& options,
                                    const std::optional<Pose3>& prior,
                                    std::uint64_t seed);

}  // namespace relocd
