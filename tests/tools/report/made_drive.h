#pragma once

#include <string>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "report_numbers.h"

namespace relocd {

/// A drive by hand: eleven seconds at 1 m/s up along y from (5, 2), a row each second. All errors
/// are across the way, so that they can be read off.
class MadeDrive {
 public:
  static constexpr int kRows = 11;
  static constexpr const char* kPoseHeader =
      "time_ns,x_m,y_m,heading_rad,cov_xx,cov_xy,cov_xt,cov_yy,cov_yt,cov_tt,status,confidence\n";

  /// A row of the truth's time k, off to the right by `error_m`, with the same sigma (m and rad) in
  /// all directions.
  static std::string Pose(int k, double error_m, double sigma, const std::string& status) {
    const double variance = sigma * sigma;
    return fmt::format("{},{},{},1.5707963267948966,{},0,0,{},0,{},{},0.5\n",
                       k * 1'000'000'000LL,
                       5.0 + error_m,
                       2.0 + k,
                       variance,
                       variance,
                       variance,
                       status);
  }
  static std::string NoPose(int k, const std::string& status) {
    return fmt::format("{},,,,,,,,,,{},0.01\n", k * 1'000'000'000LL, status);
  }

  std::string truth = "time_ns,x_m,y_m,heading_rad\n";
  /// In a frame of its own, where it goes along x, and 9 % too far.
  std::string odometry = "time_ns,x_m,y_m,heading_rad,flags\n";
  std::string camera = kPoseHeader;
  std::string fused = kPoseHeader;

  MadeDrive() {
    for (int k = 0; k < kRows; ++k) {
      truth += fmt::format("{},5,{},1.5707963267948966\n", k * 1'000'000'000LL, 2 + k);
      odometry += fmt::format("{},{},7,0,0\n", k * 1'000'000'000LL, -3.0 + 1.09 * k);
      camera += Pose(k, 0.1, 0.1, "ok");
      fused += Pose(k, 0.2, 0.1, "ok");
    }
  }

  [[nodiscard]] Result<DriveReport> Report() const {
    ReportTables tables;
    const auto read = [](const std::string& text, const char* name) {
      auto table = ParseReportTable(text, name);
      EXPECT_TRUE(table) << table.error().message;
      return std::move(table).value();
    };
    tables.truth = read(truth, "truth.csv").trajectory;
    tables.odometry = read(odometry, "odometry.csv");
    tables.camera = read(camera, "camera.csv");
    tables.fused = read(fused, "fused.csv");
    auto report = MakeDriveReport(tables);
    if (report) report->title = "made";
    return report;
  }
};

}  // namespace relocd
