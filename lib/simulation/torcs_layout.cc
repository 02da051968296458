#include "simulation/torcs_layout.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <optional>
#include <utility>

#include <fmt/format.h>
#include <pugixml.hpp>

#include "core/parse_number.h"
#include "geometry/angle.h"

namespace relocd {
namespace {

constexpr double kMaxLengthM = 200'000.0;
constexpr int kMaxSteps = 10'000;
constexpr double kStationDistanceM = 1.0;
constexpr double kMaxGapM = 1.0;
constexpr double kMaxGapRad = 0.02;
constexpr double kPi = std::numbers::pi;

struct Unit {
  std::string_view name;
  double factor;
};
constexpr std::array kUnits{Unit{"", 1.0},
                            Unit{"m", 1.0},
                            Unit{"km", 1000.0},
                            Unit{"cm", 0.01},
                            Unit{"mm", 0.001},
                            Unit{"ft", 0.3048},
                            Unit{"feet", 0.3048},
                            Unit{"in", 0.0254},
                            Unit{"inches", 0.0254},
                            Unit{"rad", 1.0},
                            Unit{"deg", kPi / 180.0},
                            Unit{"%", 0.01}};

/// Names of attributes with the range that is allowed, in SI.
struct Range {
  const char* name;
  double low;
  double high;
};
constexpr Range kWidth{"width", 2.0, 100.0};
constexpr Range kLength{"lg", 1e-3, kMaxLengthM};
constexpr Range kRadius{"radius", 1.0, 1e6};
constexpr Range kEndRadius{"end radius", 1.0, 1e6};
constexpr Range kArc{"arc", 1e-6, 4.0 * kPi};
constexpr Range kSteps{"profil steps", 1.0, kMaxSteps};
constexpr Range kStepLength{"profil steps length", 0.0, kMaxLengthM};
constexpr Range kBankingStart{"banking start", -1.4, 1.4};
constexpr Range kBankingEnd{"banking end", -1.4, 1.4};
constexpr Range Height(const char* name) {
  return {name, -10'000.0, 10'000.0};
}
constexpr Range Slope(const char* name) {
  return {name, -10.0, 10.0};
}

/// A `section` of the file, with what it is called in error messages.
class Section {
 public:
  Section(pugi::xml_node node, std::string path) : node_(node), path_(std::move(path)) {}

  [[nodiscard]] Error Fail(std::string_view problem) const {
    return {ErrorKind::kInvalidInput, fmt::format("{}: {}", path_, problem)};
  }

  [[nodiscard]] Result<Section> Child(const char* name) const {
    const pugi::xml_node child = node_.find_child_by_attribute("section", "name", name);
    if (!child) return Fail(fmt::format("has no section '{}'", name));
    return Section(child, fmt::format("{}: {}", path_, name));
  }

  [[nodiscard]] std::vector<Section> Children() const {
    std::vector<Section> children;
    for (const pugi::xml_node child : node_.children("section")) {
      children.emplace_back(child, fmt::format("{}: '{}'", path_, child.attribute("name").value()));
    }
    return children;
  }

  [[nodiscard]] std::string Text(const char* name, const char* otherwise) const {
    return node_.find_child_by_attribute("attstr", "name", name)
        .attribute("val")
        .as_string(otherwise);
  }

  /// The number in SI, or nothing where the attribute is not there.
  [[nodiscard]] Result<std::optional<double>> Number(const Range& range) const {
    const pugi::xml_node node = node_.find_child_by_attribute("attnum", "name", range.name);
    if (!node) return std::optional<double>();
    const std::string_view unit_name = node.attribute("unit").value();
    const auto* const unit = std::find_if(
        kUnits.begin(), kUnits.end(), [&](const Unit& known) { return known.name == unit_name; });
    if (unit == kUnits.end())
      return Fail(fmt::format("unit of '{}' is '{}', must be m, km, cm, mm, ft, in, rad, deg or %",
                              range.name,
                              unit_name));
    const auto value = ParseDouble(node.attribute("val").value());
    if (!value || !(*value * unit->factor >= range.low && *value * unit->factor <= range.high))
      return Fail(fmt::format("'{}' is '{} {}', must be in [{}, {}] in SI units",
                              range.name,
                              node.attribute("val").value(),
                              unit_name,
                              range.low,
                              range.high));
    return std::optional<double>(*value * unit->factor);
  }

 private:
  pugi::xml_node node_;
  std::string path_;
};

/// Reads several numbers of a section, and remembers the first error.
class NumberReader {
 public:
  explicit NumberReader(const Section& section) : section_(section) {}

  std::optional<double> Find(const Range& range) {
    auto value = section_.Number(range);
    if (value) return *value;
    if (!error_) error_ = std::move(value).error();
    return std::nullopt;
  }
  double Get(const Range& range, double otherwise) { return Find(range).value_or(otherwise); }
  double Need(const Range& range) {
    const auto value = Find(range);
    if (!value && !error_) error_ = section_.Fail(fmt::format("has no number '{}'", range.name));
    return value.value_or(range.low);
  }

  [[nodiscard]] const std::optional<Error>& error() const { return error_; }

 private:
  const Section& section_;
  std::optional<Error> error_;
};

/// How one edge of the track rises along a segment: a cubic with given heights and slopes.
struct EdgeProfile {
  double start_z = 0.0;
  double end_z = 0.0;
  double start_slope = 0.0;
  double end_slope = 0.0;

  /// @param t  part of the way, in [0, 1].
  [[nodiscard]] double At(double t, double length) const {
    const double t2 = t * t;
    const double t3 = t2 * t;
    return (2 * t3 - 3 * t2 + 1) * start_z + (t3 - 2 * t2 + t) * length * start_slope +
           (3 * t2 - 2 * t3) * end_z + (t3 - t2) * length * end_slope;
  }
};

/// One segment, as its section says: `turn` is +1 for left, -1 for right, 0 for straight.
struct Segment {
  double turn = 0.0;
  double length = 0.0;
  double radius = 0.0;
  double end_radius = 0.0;
  double arc = 0.0;
  int steps = 1;
  EdgeProfile left;
  EdgeProfile right;
};

/// Puts segments one behind the other. What a segment does not say about heights goes on from the
/// one before.
class LayoutBuilder {
 public:
  LayoutBuilder(double width, double step_length) : width_(width), step_length_(step_length) {
    stations_.push_back({.is_mesh_boundary = true});
  }

  Result<void> Append(const Section& section);
  [[nodiscard]] std::vector<TorcsStation> Take() { return std::move(stations_); }

 private:
  [[nodiscard]] Result<Segment> ReadShape(const Section& section, NumberReader& numbers) const;
  void ReadHeights(const Section& section, NumberReader& numbers, Segment& segment);
  void ReadSlopes(NumberReader& numbers, Segment& segment);
  void AppendSteps(const Segment& segment);
  void AppendStep(const Segment& segment, double length, double radius, int step);

  double width_;
  double step_length_;
  std::optional<double> grade_;
  EdgeProfile left_;
  EdgeProfile right_;
  std::vector<TorcsStation> stations_;
};

Result<Segment> LayoutBuilder::ReadShape(const Section& section, NumberReader& numbers) const {
  const std::string type = section.Text("type", "");
  Segment segment;
  if (type == "str") {
    segment.length = numbers.Need(kLength);
  } else if (type == "lft" || type == "rgt") {
    segment.turn = type == "lft" ? 1.0 : -1.0;
    segment.radius = numbers.Need(kRadius);
    segment.end_radius = numbers.Get(kEndRadius, segment.radius);
    segment.arc = numbers.Need(kArc);
    segment.length = 0.5 * (segment.radius + segment.end_radius) * segment.arc;
    // Also along spirals, whose radius is between these.
    if (const double least = std::min(segment.radius, segment.end_radius); least < width_ / 2)
      return section.Fail(
          fmt::format("radius is {}, must be at least half the width {}", least, width_));
  } else {
    return section.Fail(fmt::format("type is '{}', must be str, lft or rgt", type));
  }
  segment.steps = static_cast<int>(numbers.Get(kSteps, 1.0));
  if (segment.steps == 1) {
    const double step_length = numbers.Get(kStepLength, step_length_);
    if (step_length > 0.0)
      segment.steps = 1 + static_cast<int>(std::min(segment.length / step_length, kMaxSteps - 1.0));
  }
  return segment;
}

void LayoutBuilder::ReadHeights(const Section& section, NumberReader& numbers, Segment& segment) {
  EdgeProfile& left = segment.left;
  EdgeProfile& right = segment.right;
  left.start_z = numbers.Get(Height("z start left"), left_.end_z);
  right.start_z = numbers.Get(Height("z start right"), right_.end_z);
  left.end_z = numbers.Get(Height("z end left"), left_.end_z);
  right.end_z = numbers.Get(Height("z end right"), right_.end_z);
  if (const auto grade = numbers.Find(Slope("grade")); grade) grade_ = grade;

  const double start_z =
      numbers.Find(Height("z start")).value_or(0.5 * (left.start_z + right.start_z));
  if (numbers.Find(Height("z start"))) left.start_z = right.start_z = start_z;
  double end_z = 0.5 * (left.end_z + right.end_z);
  if (const auto given = numbers.Find(Height("z end")); given) {
    end_z = left.end_z = right.end_z = *given;
  } else if (grade_) {
    end_z = start_z + segment.length * *grade_;
  }
  const double start_banking =
      numbers.Get(kBankingStart, std::atan2(left.start_z - right.start_z, width_));
  const double end_banking = numbers.Get(kBankingEnd, std::atan2(left.end_z - right.end_z, width_));
  left.start_z = start_z + std::tan(start_banking) * width_ / 2;
  right.start_z = start_z - std::tan(start_banking) * width_ / 2;
  left.end_z = end_z + std::tan(end_banking) * width_ / 2;
  right.end_z = end_z - std::tan(end_banking) * width_ / 2;

  if (section.Text("profil", "spline") == "spline") {
    ReadSlopes(numbers, segment);
    return;
  }
  segment.steps = 1;
  left.start_slope = left.end_slope = (left.end_z - left.start_z) / segment.length;
  right.start_slope = right.end_slope = (right.end_z - right.start_z) / segment.length;
}

void LayoutBuilder::ReadSlopes(NumberReader& numbers, Segment& segment) {
  EdgeProfile& left = segment.left;
  EdgeProfile& right = segment.right;
  left.start_slope = numbers.Get(Slope("profil start tangent left"), left_.end_slope);
  right.start_slope = numbers.Get(Slope("profil start tangent right"), right_.end_slope);
  left.end_slope = numbers.Get(Slope("profil end tangent left"), left_.end_slope);
  right.end_slope = numbers.Get(Slope("profil end tangent right"), right_.end_slope);
  if (const auto start = numbers.Find(Slope("profil start tangent")); start)
    left.start_slope = right.start_slope = *start;
  if (const auto end = numbers.Find(Slope("profil end tangent")); end)
    left.end_slope = right.end_slope = *end;
}

/// A spiral is a chain of arcs whose radii go evenly from the first to the last, all of one
/// length, which is such that they turn by the segment's arc together.
void LayoutBuilder::AppendSteps(const Segment& segment) {
  double step_length = segment.length / segment.steps;
  double radius_change = 0.0;
  if (segment.end_radius != segment.radius && segment.steps > 1) {
    radius_change = (segment.end_radius - segment.radius) / (segment.steps - 1);
    double turned = 0.0;
    for (int i = 0; i < segment.steps; ++i) {
      turned += step_length / (segment.radius + i * radius_change);
    }
    step_length *= segment.arc / turned;
  }
  const bool is_circle = segment.radius == segment.end_radius;
  for (int i = 0; i < segment.steps; ++i) {
    AppendStep(segment, step_length, segment.radius + (is_circle ? 0.0 : i * radius_change), i);
  }
}

/// Heights are straight within a step, as in the mesh.
void LayoutBuilder::AppendStep(const Segment& segment, double length, double radius, int step) {
  const TorcsStation start = stations_.back();
  const double steps = segment.steps;
  const double end_left_z = segment.left.At((step + 1) / steps, segment.length);
  const double end_right_z = segment.right.At((step + 1) / steps, segment.length);
  const double start_left_z = segment.left.At(step / steps, segment.length);
  const double start_right_z = segment.right.At(step / steps, segment.length);
  const int parts = std::max(1, static_cast<int>(std::ceil(length / kStationDistanceM)));
  for (int i = 1; i <= parts; ++i) {
    const double part = static_cast<double>(i) / parts;
    const double along = part * length;
    const double turned = segment.turn == 0.0 ? 0.0 : segment.turn * along / radius;
    // The chord of an arc, which is along its middle direction.
    const double chord = turned == 0.0 ? along : 2.0 * radius * std::sin(0.5 * std::abs(turned));
    const double direction = start.yaw_T_rad + 0.5 * turned;
    stations_.push_back(
        {.p_T = start.p_T + chord * Eigen::Vector2d(std::cos(direction), std::sin(direction)),
         .yaw_T_rad = start.yaw_T_rad + turned,
         .left_z_T = start_left_z + part * (end_left_z - start_left_z),
         .right_z_T = start_right_z + part * (end_right_z - start_right_z),
         .s_m = start.s_m + along,
         .is_mesh_boundary = i == parts});
  }
}

Result<void> LayoutBuilder::Append(const Section& section) {
  NumberReader numbers(section);
  auto segment = ReadShape(section, numbers);
  if (numbers.error()) return *numbers.error();
  if (!segment) return std::move(segment).error();
  ReadHeights(section, numbers, *segment);
  if (numbers.error()) return *numbers.error();
  if (stations_.back().s_m + segment->length > kMaxLengthM)
    return section.Fail(
        fmt::format("the track gets longer than {} m, the most that is allowed", kMaxLengthM));
  if (stations_.size() == 1) {
    stations_.front().left_z_T = segment->left.start_z;
    stations_.front().right_z_T = segment->right.start_z;
  }
  AppendSteps(*segment);
  left_ = segment->left;
  right_ = segment->right;
  return {};
}

/// Moves the last station onto the first one, and all others by their part of that.
Result<void> CloseLoop(std::vector<TorcsStation>& stations, const std::string& path) {
  const TorcsStation first = stations.front();
  const TorcsStation last = stations.back();
  const Eigen::Vector2d gap = first.p_T - last.p_T;
  const double yaw_gap = std::abs(WrapAngle(last.yaw_T_rad - first.yaw_T_rad));
  if (gap.norm() > kMaxGapM || yaw_gap > kMaxGapRad || last.s_m < 10.0 * kMaxGapM)
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("{}: the track ends {:.2f} m and {:.3f} rad from its beginning after "
                             "{:.0f} m, must be within {} m and {} rad after {} m or more",
                             path,
                             gap.norm(),
                             yaw_gap,
                             last.s_m,
                             kMaxGapM,
                             kMaxGapRad,
                             10.0 * kMaxGapM)};
  for (TorcsStation& station : stations) {
    station.p_T += station.s_m / last.s_m * gap;
  }
  return {};
}

Result<TorcsLayout> ReadSections(const Section& file, const std::string& path) {
  const auto graphic = file.Child("Graphic");
  if (!graphic) return graphic.error();
  const auto track = file.Child("Main Track");
  if (!track) return track.error();
  auto segments = track->Child("Track Segments");
  if (!segments) segments = track->Child("segments");
  if (!segments) return track->Fail("has no section 'Track Segments'");

  NumberReader numbers(*track);
  TorcsLayout layout{.mesh_file = graphic->Text("3d description", ""),
                     .width_m = numbers.Get(kWidth, 15.0),
                     .stations = {}};
  LayoutBuilder builder(layout.width_m, numbers.Get(kStepLength, 0.0));
  if (numbers.error()) return *numbers.error();
  if (layout.mesh_file.empty()) return graphic->Fail("has no text '3d description'");
  for (const Section& segment : segments->Children()) {
    if (auto ok = builder.Append(segment); !ok) return ok.error();
  }
  layout.stations = builder.Take();
  if (auto ok = CloseLoop(layout.stations, path); !ok) return ok.error();
  return layout;
}

}  // namespace

Result<TorcsLayout> ParseTorcsLayout(std::string_view xml, const std::string& path) {
  pugi::xml_document document;
  // Entities of the document's own type, of which TORCS' files have some, stay text.
  const pugi::xml_parse_result parsed = document.load_buffer(xml.data(), xml.size());
  if (!parsed) {
    const auto end = xml.begin() + std::min(parsed.offset, static_cast<std::ptrdiff_t>(xml.size()));
    return Error{
        ErrorKind::kInvalidInput,
        fmt::format(
            "{}: line {}: {}", path, 1 + std::count(xml.begin(), end, '\n'), parsed.description())};
  }
  const pugi::xml_node root = document.child("params");
  if (!root) return Error{ErrorKind::kInvalidInput, path + ": has no element 'params' at its top"};
  return ReadSections(Section(root, path), path);
}

}  // namespace relocd
