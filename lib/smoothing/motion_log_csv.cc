#include "smoothing/motion_log_csv.h"

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <optional>
#include <utility>

#include <Eigen/Core>
#include <fmt/format.h>

#include "core/csv.h"
#include "core/file.h"
#include "geometry/covariance.h"

namespace relocd {
namespace {

/// In metres and rad: what is beyond it is no place on the Earth, and its square may be infinite.
constexpr double kLargestNumber = 1e8;

/// The rows of a table with a time and perhaps a covariance.
class MotionTable {
 public:
  static Result<MotionTable> Parse(std::string_view text, const std::string& path) {
    auto csv = CsvTable::Parse(text, path);
    if (!csv) return std::move(csv).error();
    MotionTable table(std::move(csv).value());
    auto time = table.csv_.Columns({"time_ns"});
    if (!time) return std::move(time).error();
    table.time_ = time->front();
    if (!table.csv_.FindColumn("cov_xx")) return table;
    auto covariance =
        table.csv_.Columns({"cov_xx", "cov_xy", "cov_xt", "cov_yy", "cov_yt", "cov_tt"});
    if (!covariance) return std::move(covariance).error();
    table.covariance_ = std::move(covariance).value();
    return table;
  }

  [[nodiscard]] const CsvTable& csv() const { return csv_; }
  [[nodiscard]] std::size_t row_count() const { return csv_.row_count(); }

  /// The row's time, which must be above the last one asked for.
  Result<MonotonicTime> NextTime(std::size_t row) {
    auto time_ns = csv_.Int64(row, time_);
    if (!time_ns) return std::move(time_ns).error();
    if (last_time_ns_ && *time_ns <= *last_time_ns_) {
      return Error{ErrorKind::kInvalidInput,
                   fmt::format("{}: time_ns is {}, must be above the row before's {}",
                               csv_.Where(row),
                               *time_ns,
                               *last_time_ns_)};
    }
    last_time_ns_ = *time_ns;
    return FromNanoseconds(*time_ns);
  }

  /// Three numbers of a row.
  [[nodiscard]] Result<Eigen::Vector3d> Numbers(std::size_t row,
                                                const std::vector<std::size_t>& columns) const {
    Eigen::Vector3d numbers = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < columns.size(); ++i) {
      auto number = csv_.Double(row, columns[i]);
      if (!number) return std::move(number).error();
      if (std::abs(*number) > kLargestNumber) {
        return Error{ErrorKind::kInvalidInput,
                     fmt::format("{}: a number is {}, must be within {} m or rad",
                                 csv_.Where(row),
                                 *number,
                                 kLargestNumber)};
      }
      numbers[static_cast<Eigen::Index>(i)] = *number;
    }
    return numbers;
  }

  /// Nothing when the table has none, or the row's cells are empty.
  [[nodiscard]] Result<std::optional<Eigen::Matrix3d>> Covariance(std::size_t row,
                                                                  bool has_heading) const {
    if (covariance_.empty() || csv_.Text(row, covariance_.front()).empty()) {
      return std::optional<Eigen::Matrix3d>();
    }
    std::array<double, 6> c{};
    for (std::size_t i = 0; i < c.size(); ++i) {
      auto value = csv_.OptionalDouble(row, covariance_[i]);
      if (!value) return std::move(value).error();
      c.at(i) = value->value_or(0.0);
    }
    Eigen::Matrix3d covariance;
    covariance << c[0], c[1], c[2], c[1], c[3], c[4], c[2], c[4], c[5];
    const bool is_usable =
        has_heading ? IsCovariance(covariance) : IsCovariance(covariance.topLeftCorner<2, 2>());
    if (!is_usable) {
      return Error{ErrorKind::kInvalidInput,
                   fmt::format("{}: cov_xx,...,cov_tt is {},{},{},{},{},{}, must be positive "
                               "definite",
                               csv_.Where(row),
                               c[0],
                               c[1],
                               c[2],
                               c[3],
                               c[4],
                               c[5])};
    }
    return std::optional(covariance);
  }

 private:
  explicit MotionTable(CsvTable csv) : csv_(std::move(csv)) {}

  CsvTable csv_;
  std::size_t time_ = 0;
  std::vector<std::size_t> covariance_;
  std::optional<std::int64_t> last_time_ns_;
};

}  // namespace

Result<std::vector<OdometryStep>> ParseOdometryCsv(std::string_view text,
                                                   const std::string& path,
                                                   const SmootherConfig& config) {
  auto table = MotionTable::Parse(text, path);
  if (!table) return std::move(table).error();
  const auto columns = table->csv().Columns({"dx_m", "dy_m", "dtheta_rad"});
  if (!columns) return columns.error();
  std::vector<OdometryStep> steps;
  steps.reserve(table->row_count());
  for (std::size_t row = 0; row < table->row_count(); ++row) {
    const auto time = table->NextTime(row);
    if (!time) return time.error();
    const auto motion = table->Numbers(row, *columns);
    if (!motion) return motion.error();
    const auto covariance = table->Covariance(row, true);
    if (!covariance) return covariance.error();
    const Duration duration = steps.empty() ? Duration(0) : *time - steps.back().time;
    OdometryStep step = MakeOdometryStep(*time,
                                         duration,
                                         Pose2(motion->x(), motion->y(), motion->z()),
                                         config.default_odometry_noise);
    if (*covariance) step.covariance = **covariance;
    steps.push_back(step);
  }
  return steps;
}

Result<std::vector<Fix>> ParseFixesCsv(std::string_view text,
                                       const std::string& path,
                                       const SmootherConfig& config) {
  auto table = MotionTable::Parse(text, path);
  if (!table) return std::move(table).error();
  const auto columns = table->csv().Columns({"x_m", "y_m"});
  if (!columns) return columns.error();
  const auto heading_column = table->csv().FindColumn("heading_rad");
  std::vector<Fix> fixes;
  fixes.reserve(table->row_count());
  for (std::size_t row = 0; row < table->row_count(); ++row) {
    const auto time = table->NextTime(row);
    if (!time) return time.error();
    const auto position = table->Numbers(row, *columns);
    if (!position) return position.error();
    const auto heading = heading_column ? table->csv().OptionalDouble(row, *heading_column)
                                        : Result<std::optional<double>>(std::nullopt);
    if (!heading) return heading.error();
    const auto covariance = table->Covariance(row, heading->has_value());
    if (!covariance) return covariance.error();
    Fix fix =
        MakePoseFix(*time, Pose2(position->x(), position->y(), heading->value_or(0.0)), config);
    fix.has_heading = heading->has_value();
    if (*covariance) fix.covariance = **covariance;
    fixes.push_back(fix);
  }
  return fixes;
}

Result<MotionLog> ReadMotionLog(const std::string& odometry_path,
                                const std::string& fixes_path,
                                const SmootherConfig& config) {
  const auto odometry_text = ReadFile(odometry_path);
  if (!odometry_text) return odometry_text.error();
  auto odometry = ParseOdometryCsv(*odometry_text, odometry_path, config);
  if (!odometry) return std::move(odometry).error();
  const auto fixes_text = ReadFile(fixes_path);
  if (!fixes_text) return fixes_text.error();
  auto fixes = ParseFixesCsv(*fixes_text, fixes_path, config);
  if (!fixes) return std::move(fixes).error();
  return MotionLog{.odometry = std::move(odometry).value(), .fixes = std::move(fixes).value()};
}

std::string FormatEstimatesCsv(const std::vector<SmootherEstimate>& estimates) {
  std::string text =
      "time_ns,x_m,y_m,heading_rad,cov_xx,cov_xy,cov_xt,cov_yy,cov_yt,cov_tt,status\n";
  for (const SmootherEstimate& estimate : estimates) {
    fmt::format_to(std::back_inserter(text), "{}", ToNanoseconds(estimate.time));
    if (estimate.has_pose && estimate.status != SmootherStatus::kUninitialised) {
      const Eigen::Matrix3d& c = estimate.covariance;
      fmt::format_to(std::back_inserter(text),
                     ",{:.6f},{:.6f},{:.8f},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g}",
                     estimate.X_WB.x(),
                     estimate.X_WB.y(),
                     estimate.X_WB.yaw(),
                     c(0, 0),
                     c(0, 1),
                     c(0, 2),
                     c(1, 1),
                     c(1, 2),
                     c(2, 2));
    } else {
      text += ",,,,,,,,,";
    }
    fmt::format_to(std::back_inserter(text), ",{}\n", ToString(estimate.status));
  }
  return text;
}

}  // namespace relocd
