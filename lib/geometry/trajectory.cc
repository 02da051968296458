#include "geometry/trajectory.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <utility>

#include <fmt/format.h>

#include "core/file.h"
#include "core/parse_number.h"

namespace relocd {
namespace {

constexpr std::size_t kTumFields = 8;
constexpr double kNanosecondsPerSecond = 1e9;

std::optional<std::array<double, kTumFields>> ParseTumFields(std::string_view line) {
  std::array<double, kTumFields> fields{};
  for (double& field : fields) {
    line = Trim(line);
    const auto end = std::min(line.find_first_of(" \t,"), line.size());
    const auto value = ParseDouble(line.substr(0, end));
    if (!value || !std::isfinite(*value)) return std::nullopt;
    field = *value;
    line.remove_prefix(std::min(end + 1, line.size()));
  }
  if (!Trim(line).empty()) return std::nullopt;
  return fields;
}

Result<TimedPose3> ParseTumLine(std::string_view line, const std::string& where) {
  const auto fields = ParseTumFields(line);
  if (!fields) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("{}: is '{}', must be 'time_s tx ty tz qx qy qz qw'", where, line)};
  }
  const auto& f = *fields;
  const Eigen::Quaterniond q(f[7], f[4], f[5], f[6]);
  constexpr double kShortest = 1e-3;
  if (q.norm() < kShortest) {
    return Error{
        ErrorKind::kInvalidInput,
        fmt::format("{}: the quaternion's length is {}, must not be zero", where, q.norm())};
  }
  return TimedPose3{.time_ns = std::llround(f[0] * kNanosecondsPerSecond),
                    .X_WB = Pose3(q, {f[1], f[2], f[3]})};
}

/// Pose is Pose2 or Pose3, which have the same names for the same things.
template <typename Timed>
auto InterpolateOnGroup(const std::vector<Timed>& trajectory,
                        std::int64_t time_ns,
                        std::int64_t max_gap_ns) -> std::optional<decltype(Timed::X_WB)> {
  using Pose = decltype(Timed::X_WB);
  const auto after = std::lower_bound(
      trajectory.begin(), trajectory.end(), time_ns, [](const Timed& timed, std::int64_t time) {
        return timed.time_ns < time;
      });
  if (after == trajectory.end()) return std::nullopt;
  if (after->time_ns == time_ns) return after->X_WB;
  if (after == trajectory.begin()) return std::nullopt;
  const auto before = std::prev(after);
  const std::int64_t gap_ns = after->time_ns - before->time_ns;
  if (gap_ns > max_gap_ns) return std::nullopt;
  const double share = static_cast<double>(time_ns - before->time_ns) / static_cast<double>(gap_ns);
  return before->X_WB * Pose::Exp(share * (before->X_WB.Inverse() * after->X_WB).Log());
}

}  // namespace

Result<Trajectory3> ReadTumTrajectory(const std::string& path) {
  auto text = ReadFile(path);
  if (!text) return std::move(text).error();
  return ParseTumTrajectory(*text, path);
}

Result<Trajectory3> ParseTumTrajectory(std::string_view text, const std::string& path) {
  Trajectory3 trajectory;
  for (int line_number = 1; !text.empty(); ++line_number) {
    const auto end = text.find('\n');
    const std::string_view line = Trim(text.substr(0, end));
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    if (line.empty() || line.starts_with('#')) continue;
    const std::string where = fmt::format("{}: line {}", path, line_number);
    auto pose = ParseTumLine(line, where);
    if (!pose) return std::move(pose).error();
    if (!trajectory.empty() && pose->time_ns <= trajectory.back().time_ns) {
      return Error{
          ErrorKind::kInvalidInput,
          fmt::format("{}: the time is {} s, must be above the line before's {} s",
                      where,
                      static_cast<double>(pose->time_ns) / kNanosecondsPerSecond,
                      static_cast<double>(trajectory.back().time_ns) / kNanosecondsPerSecond)};
    }
    trajectory.push_back(*pose);
  }
  return trajectory;
}

std::string FormatTumTrajectory(const Trajectory3& trajectory) {
  std::string text = "# time_s tx ty tz qx qy qz qw\n";
  for (const TimedPose3& pose : trajectory) {
    const Eigen::Vector3d& p = pose.X_WB.translation();
    const Eigen::Quaterniond& q = pose.X_WB.rotation();
    fmt::format_to(std::back_inserter(text),
                   "{:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f} {:.9f}\n",
                   static_cast<double>(pose.time_ns) / kNanosecondsPerSecond,
                   p.x(),
                   p.y(),
                   p.z(),
                   q.x(),
                   q.y(),
                   q.z(),
                   q.w());
  }
  return text;
}

std::optional<Pose2> Interpolate(const Trajectory2& trajectory,
                                 std::int64_t time_ns,
                                 std::int64_t max_gap_ns) {
  return InterpolateOnGroup(trajectory, time_ns, max_gap_ns);
}

std::optional<Pose3> Interpolate(const Trajectory3& trajectory,
                                 std::int64_t time_ns,
                                 std::int64_t max_gap_ns) {
  return InterpolateOnGroup(trajectory, time_ns, max_gap_ns);
}

}  // namespace relocd
