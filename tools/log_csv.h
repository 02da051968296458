#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <utility>

#include "core/result.h"

namespace relocd {

/// Writes the messages of one channel as rows of
/// `time_ns,x_m,y_m,heading_rad,cov_xx,...,cov_tt,status`, which reloc eval reads.
///
/// LOCALIZATION gives X_WB; ODOMETRY gives X_OB, without the columns of the covariance, which it
/// does not carry; CAMERA_POSE gives where the camera stands and where it looks (X_WC in the
/// plane), one row for each pose that was found.
class LogCsv {
 public:
  static constexpr const char* kChannels = "LOCALIZATION, ODOMETRY or CAMERA_POSE";

  /// @param time_origin_ns  taken off every mono_ns.
  /// @return kInvalidInput for a channel that has no such rows.
  static Result<LogCsv> ForChannel(const std::string& channel, std::int64_t time_origin_ns);

  [[nodiscard]] const std::string& header() const { return header_; }

  /// @return whether the message decodes. One without a pose decodes and adds no row.
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
