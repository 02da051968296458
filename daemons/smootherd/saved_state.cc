#include "smootherd/saved_state.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "core/parse_number.h"
#include "geometry/covariance.h"

namespace relocd {
namespace {

constexpr std::string_view kFormat = "relocd smootherd 1";
constexpr std::array<std::string_view, 8> kKeys{
    "format", "boot_id", "mono_ns", "odometry_run_id", "map_id", "X_WB", "X_OB", "covariance"};
constexpr std::size_t kPoseNumbers = 3;
constexpr std::size_t kCovarianceNumbers = 9;

/// A value and the line that it stands on.
struct Entry {
  std::string value;
  int line = 0;
};

/// The text's entries by key. Reading goes on after an error, which is kept: the first one.
class StateReader {
 public:
  StateReader(std::string_view text, const std::string& path) : path_(path) { Split(text); }

  [[nodiscard]] std::string Text(std::string_view key) { return Find(key).value; }

  [[nodiscard]] std::int64_t Int64(std::string_view key) {
    const Entry entry = Find(key);
    const auto value = ParseInt64(entry.value);
    if (!value) Fail(entry.line, fmt::format("{} is '{}', must be an integer", key, entry.value));
    return value.value_or(0);
  }

  /// `count` finite numbers, whatever the text says.
  [[nodiscard]] std::vector<double> Numbers(std::string_view key, std::size_t count) {
    const Entry entry = Find(key);
    std::vector<double> numbers;
    std::string_view rest = Trim(entry.value);
    while (!rest.empty()) {
      const auto end = std::min(rest.find(' '), rest.size());
      const auto number = ParseDouble(rest.substr(0, end));
      if (!number || !std::isfinite(*number)) break;
      numbers.push_back(*number);
      rest = Trim(rest.substr(end));
    }
    if (!rest.empty() || numbers.size() != count) {
      Fail(entry.line,
           fmt::format("{} is '{}', must be {} finite numbers", key, entry.value, count));
      numbers.assign(count, 0.0);
    }
    return numbers;
  }

  void Fail(int line, const std::string& what) {
    if (error_) return;
    const std::string where = line > 0 ? fmt::format("{}: line {}", path_, line) : path_;
    error_ = Error{ErrorKind::kInvalidInput, fmt::format("{}: {}", where, what)};
  }
  [[nodiscard]] const std::optional<Error>& error() const { return error_; }
  [[nodiscard]] int LineOf(std::string_view key) { return Find(key).line; }

 private:
  void Split(std::string_view text) {
    for (int line_number = 1; !text.empty(); ++line_number) {
      const auto end = text.find('\n');
      const std::string_view line = Trim(text.substr(0, end));
      text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
      if (line.empty()) continue;
      const auto colon = line.find(':');
      const std::string key(Trim(line.substr(0, colon)));
      if (colon == std::string_view::npos ||
          std::find(kKeys.begin(), kKeys.end(), key) == kKeys.end()) {
        Fail(line_number,
             fmt::format("is '{}', must be one of {} with a value", line, fmt::join(kKeys, ", ")));
        continue;
      }
      const Entry entry{std::string(Trim(line.substr(colon + 1))), line_number};
      if (!entries_.emplace(key, entry).second) {
        Fail(line_number, fmt::format("{} is given twice, must be given once", key));
      }
    }
  }

  Entry Find(std::string_view key) {
    const auto found = entries_.find(std::string(key));
    if (found != entries_.end()) return found->second;
    Fail(0, fmt::format("has no {}, must have each of {}", key, fmt::join(kKeys, ", ")));
    return {};
  }

  std::string path_;
  std::map<std::string, Entry> entries_;
  std::optional<Error> error_;
};

Pose2 ToPose(const std::vector<double>& numbers) {
  return {numbers[0], numbers[1], numbers[2]};
}

}  // namespace

std::string FormatSavedState(const SavedState& state) {
  const auto format_pose = [](const Pose2& pose) {
    return fmt::format("{} {} {}", pose.x(), pose.y(), pose.yaw());  // shortest that reads back
  };
  std::vector<double> covariance(state.covariance.data(),
                                 state.covariance.data() + state.covariance.size());
  return fmt::format(
      "format: {}\nboot_id: {}\nmono_ns: {}\nodometry_run_id: {}\nmap_id: {}\nX_WB: {}\nX_OB: {}\n"
      "covariance: {}\n",
      kFormat,
      state.boot_id,
      ToNanoseconds(state.time),
      state.odometry_run_id,
      state.map_id,
      format_pose(state.X_WB),
      format_pose(state.X_OB),
      fmt::join(covariance, " "));
}

Result<SavedState> ParseSavedState(std::string_view text, const std::string& path) {
  StateReader reader(text, path);
  if (reader.Text("format") != kFormat) {
    reader.Fail(reader.LineOf("format"),
                fmt::format("format is '{}', must be '{}'", reader.Text("format"), kFormat));
  }
  SavedState state;
  state.boot_id = reader.Text("boot_id");
  state.time = FromNanoseconds(reader.Int64("mono_ns"));
  if (state.time < MonotonicTime()) {
    reader.Fail(reader.LineOf("mono_ns"),
                fmt::format("mono_ns is {}, must be >= 0", reader.Text("mono_ns")));
  }
  state.odometry_run_id = reader.Int64("odometry_run_id");
  state.map_id = reader.Text("map_id");
  state.X_WB = ToPose(reader.Numbers("X_WB", kPoseNumbers));
  state.X_OB = ToPose(reader.Numbers("X_OB", kPoseNumbers));
  const std::vector<double> covariance = reader.Numbers("covariance", kCovarianceNumbers);
  state.covariance = Eigen::Map<const Eigen::Matrix3d>(covariance.data());
  if (!IsCovariance(state.covariance)) {
    reader.Fail(reader.LineOf("covariance"),
                fmt::format("covariance is '{}', must be symmetric and positive definite",
                            reader.Text("covariance")));
  }
  if (reader.error()) return *reader.error();
  return state;
}

}  // namespace relocd
