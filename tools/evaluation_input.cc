#include "evaluation_input.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "core/csv.h"
#include "core/file.h"
#include "core/index_range.h"
#include "core/parse_number.h"
#include "geometry/covariance.h"
#include "geometry/planar.h"
#include "geometry/trajectory.h"

namespace relocd {
namespace {

constexpr double kNanosecondsPerSecond = 1e9;
constexpr std::string_view kPlanarForm = "time_ns,x_m,y_m[,heading_rad[,cov_xx,...,cov_tt]]";
constexpr std::string_view kSpatialForm = "time_s,tx_m,ty_m,tz_m,qw,qx,qy,qz";

/// Whether the first line that is no comment begins with a column's name.
bool IsCsv(std::string_view text) {
  while (!text.empty()) {
    const auto end = std::min(text.find('\n'), text.size());
    const std::string_view line = Trim(text.substr(0, end));
    if (!line.empty() && line.front() != '#') {
      return std::isalpha(static_cast<unsigned char>(line.front())) != 0;
    }
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return false;
}

/// Reads the rows of one CSV file.
class CsvRows {
 public:
  static Result<CsvRows> Open(CsvTable table);

  [[nodiscard]] bool planar() const { return planar_; }
  [[nodiscard]] std::size_t count() const { return table_.row_count(); }
  [[nodiscard]] std::string Where(std::size_t row) const { return table_.Where(row); }
  [[nodiscard]] std::string Status(std::size_t row) const {
    return status_ ? table_.Text(row, *status_) : "no pose";
  }

  /// Nothing for a row with an empty position.
  [[nodiscard]] Result<std::optional<EvaluatedPose>> Pose(std::size_t row) const;

 private:
  explicit CsvRows(CsvTable table) : table_(std::move(table)) {}

  [[nodiscard]] Result<std::int64_t> Time(std::size_t row) const;
  [[nodiscard]] Result<void> ReadPlanar(std::size_t row, EvaluatedPose& pose) const;
  [[nodiscard]] Result<void> ReadSpatial(std::size_t row, EvaluatedPose& pose) const;
  [[nodiscard]] Result<void> ReadCovariance(std::size_t row, EvaluatedPose& pose) const;

  CsvTable table_;
  bool planar_ = false;
  std::size_t time_ = 0;
  bool time_in_seconds_ = false;
  std::vector<std::size_t> position_;    ///< x, y or x, y, z.
  std::vector<std::size_t> quaternion_;  ///< w, x, y, z.
  std::optional<std::size_t> heading_;
  std::vector<std::size_t> covariance_;  ///< xx, xy, xt, yy, yt, tt; empty when there is none.
  std::optional<std::size_t> status_;
};

Result<CsvRows> CsvRows::Open(CsvTable table) {
  CsvRows rows(std::move(table));
  const CsvTable& csv = rows.table_;
  const auto time_ns = csv.FindColumn("time_ns");
  auto time_s = csv.FindColumn("time_s");
  if (!time_s) time_s = csv.FindColumn("t_s");
  rows.planar_ = csv.FindColumn("x_m").has_value();
  const bool is_spatial = csv.FindColumn("tx_m").has_value();
  if ((!time_ns && !time_s) || (!rows.planar_ && !is_spatial)) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("{}: line 1: the header has no time or no position, must be as '{}', "
                             "'{}', or the file in TUM format",
                             csv.path(),
                             kPlanarForm,
                             kSpatialForm)};
  }
  rows.time_ = time_ns ? *time_ns : *time_s;
  rows.time_in_seconds_ = !time_ns;
  rows.status_ = csv.FindColumn("status");
  auto position =
      rows.planar_ ? csv.Columns({"x_m", "y_m"}) : csv.Columns({"tx_m", "ty_m", "tz_m"});
  if (!position) return std::move(position).error();
  rows.position_ = std::move(position).value();
  if (is_spatial && !rows.planar_) {
    auto quaternion = csv.Columns({"qw", "qx", "qy", "qz"});
    if (!quaternion) return std::move(quaternion).error();
    rows.quaternion_ = std::move(quaternion).value();
    return rows;
  }
  rows.heading_ = csv.FindColumn("heading_rad");
  if (!rows.heading_) rows.heading_ = csv.FindColumn("theta_rad");
  if (!csv.FindColumn("cov_xx")) return rows;
  auto covariance = csv.Columns({"cov_xx", "cov_xy", "cov_xt", "cov_yy", "cov_yt", "cov_tt"});
  if (!covariance) return std::move(covariance).error();
  rows.covariance_ = std::move(covariance).value();
  return rows;
}

Result<std::int64_t> CsvRows::Time(std::size_t row) const {
  if (!time_in_seconds_) return table_.Int64(row, time_);
  const auto seconds = table_.Double(row, time_);
  if (!seconds) return seconds.error();
  return static_cast<std::int64_t>(std::llround(*seconds * kNanosecondsPerSecond));
}

Result<std::optional<EvaluatedPose>> CsvRows::Pose(std::size_t row) const {
  EvaluatedPose pose;
  const auto time = Time(row);
  if (!time) return time.error();
  pose.time_ns = *time;
  if (table_.Text(row, position_.front()).empty()) return std::optional<EvaluatedPose>();
  auto ok = planar_ ? ReadPlanar(row, pose) : ReadSpatial(row, pose);
  if (!ok) return std::move(ok).error();
  return std::optional(pose);
}

Result<void> CsvRows::ReadPlanar(std::size_t row, EvaluatedPose& pose) const {
  const auto x = table_.Double(row, position_[0]);
  if (!x) return x.error();
  const auto y = table_.Double(row, position_[1]);
  if (!y) return y.error();
  const auto heading = heading_ ? table_.OptionalDouble(row, *heading_)
                                : Result<std::optional<double>>(std::nullopt);
  if (!heading) return heading.error();
  pose.has_heading = heading->has_value();
  pose.X_WB = LiftFromPlane(Pose2(*x, *y, heading->value_or(0.0)));
  return ReadCovariance(row, pose);
}

Result<void> CsvRows::ReadCovariance(std::size_t row, EvaluatedPose& pose) const {
  if (covariance_.empty() || table_.Text(row, covariance_.front()).empty()) return {};
  std::array<double, 6> c{};
  for (std::size_t i = 0; i < c.size(); ++i) {
    const auto value = table_.OptionalDouble(row, covariance_[i]);
    if (!value) return value.error();
    c.at(i) = value->value_or(0.0);
  }
  Eigen::Matrix3d covariance;
  covariance << c[0], c[1], c[2], c[1], c[3], c[4], c[2], c[4], c[5];
  const bool valid =
      pose.has_heading ? IsCovariance(covariance) : IsCovariance(covariance.topLeftCorner<2, 2>());
  if (!valid) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("{}: cov_xx,...,cov_tt is {}, must be symmetric and positive definite",
                             table_.Where(row),
                             fmt::join(c, ","))};
  }
  pose.covariance = covariance;
  return {};
}

Result<void> CsvRows::ReadSpatial(std::size_t row, EvaluatedPose& pose) const {
  std::array<double, 7> p{};
  for (std::size_t i = 0; i < p.size(); ++i) {
    const auto value = table_.Double(row, i < 3 ? position_[i] : quaternion_[i - 3]);
    if (!value) return value.error();
    p.at(i) = *value;
  }
  const Eigen::Quaterniond rotation(p[3], p[4], p[5], p[6]);
  constexpr double kShortest = 1e-3;
  if (rotation.norm() < kShortest) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("{}: the quaternion's length is {}, must not be zero",
                             table_.Where(row),
                             rotation.norm())};
  }
  pose.X_WB = Pose3(rotation, Eigen::Vector3d(p[0], p[1], p[2]));
  return {};
}

Result<IndexRange> ParseRows(std::string_view rows, std::size_t count, const std::string& path) {
  if (count == 0) {
    return Error{ErrorKind::kInvalidInput, path + ": has no rows, must have at least one"};
  }
  auto range = ParseIndexRange(rows, count);
  if (!range) return std::move(range).error().WithContext(path + ": rows");
  return range;
}

Result<EvaluatedTrajectory> ParseCsv(std::string_view text,
                                     const std::string& path,
                                     std::string_view rows_text) {
  auto table = CsvTable::Parse(text, path);
  if (!table) return std::move(table).error();
  const auto rows = CsvRows::Open(std::move(table).value());
  if (!rows) return rows.error();
  const auto range = ParseRows(rows_text, rows->count(), path);
  if (!range) return range.error();
  EvaluatedTrajectory trajectory{.path = path,
                                 .planar = rows->planar(),
                                 .rows = range->size(),
                                 .poses = {},
                                 .rows_without_pose = {}};
  for (std::size_t row = range->begin; row < range->end; ++row) {
    const auto pose = rows->Pose(row);
    if (!pose) return pose.error();
    if (!pose->has_value()) {
      ++trajectory.rows_without_pose[rows->Status(row)];
      continue;
    }
    if (!trajectory.poses.empty() && (*pose)->time_ns <= trajectory.poses.back().time_ns) {
      return Error{ErrorKind::kInvalidInput,
                   fmt::format("{}: the time is {} ns, must be above the row before's {} ns",
                               rows->Where(row),
                               (*pose)->time_ns,
                               trajectory.poses.back().time_ns)};
    }
    trajectory.poses.push_back(**pose);
  }
  return trajectory;
}

Result<EvaluatedTrajectory> ParseTum(std::string_view text,
                                     const std::string& path,
                                     std::string_view rows_text) {
  const auto poses = ParseTumTrajectory(text, path);
  if (!poses) return poses.error();
  const auto range = ParseRows(rows_text, poses->size(), path);
  if (!range) return range.error();
  EvaluatedTrajectory trajectory{
      .path = path, .planar = false, .rows = range->size(), .poses = {}, .rows_without_pose = {}};
  for (std::size_t row = range->begin; row < range->end; ++row)
    trajectory.poses.push_back(
        {.time_ns = (*poses)[row].time_ns, .X_WB = (*poses)[row].X_WB, .covariance = std::nullopt});
  return trajectory;
}

}  // namespace

Result<EvaluatedTrajectory> ParseEvaluatedTrajectory(std::string_view text,
                                                     const std::string& path,
                                                     std::string_view rows) {
  return IsCsv(text) ? ParseCsv(text, path, rows) : ParseTum(text, path, rows);
}

Result<EvaluatedTrajectory> ReadEvaluatedTrajectory(const std::string& path,
                                                    std::string_view rows) {
  const auto text = ReadFile(path);
  if (!text) return text.error();
  return ParseEvaluatedTrajectory(*text, path, rows);
}

}  // namespace relocd
