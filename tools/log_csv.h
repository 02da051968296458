#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <span>
#include <string>
#include <utility>

#include "core/result.h"
#include "geometry/pose3.h"

namespace relocd {

/// How messages become rows.
struct LogCsvOptions {
  std::int64_t time_origin_ns = 0;  ///< Taken off every mono_ns.
  /// Where each camera is on the body, by its name: CAMERA_POSE then gives the body's pose. Empty:
  /// the camera's.
  std::map<std::string, Pose3> X_BC;
};

/// Writes the messages of one channel as rows of
/// `time_ns,x_m,y_m,heading_rad,cov_xx,...,cov_tt,status`, which reloc eval and reloc report read.
///
/// LOCALIZATION gives X_WB; ODOMETRY gives X_OB, without the columns of the covariance, which it
/// does not carry; CAMERA_POSE gives X_WB, or else where the camera stands and where it looks (X_WC
/// in the plane), and behind it `inliers,confidence`. A message without a pose gives a row with its
/// status, the reason, and empty cells.
class LogCsv {
 public:
  static constexpr const char* kChannels = "LOCALIZATION, ODOMETRY or CAMERA_POSE";

  /// @return kInvalidInput for a channel that has no such rows.
  static Result<LogCsv> ForChannel(const std::string& channel, const LogCsvOptions& options);

  [[nodiscard]] const std::string& header() const { return header_; }

  /// @return whether the message decodes.
  bool AppendRow(std::span<const std::uint8_t> message, std::string& text) const {
    return append_(message, text);
  }

 private:
  using Append = std::function<bool(std::span<const std::uint8_t>, std::string&)>;
  LogCsv(std::string header, Append append)
      : header_(std::move(header)), append_(std::move(append)) {}

  std::string header_;
  Append append_;
};

}  // namespace relocd
