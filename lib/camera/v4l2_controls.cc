#include "camera/v4l2_controls.h"

#include <errno.h>
#include <linux/videodev2.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <optional>
#include <span>
#include <system_error>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "camera/frame_source.h"

namespace relocd {
namespace {

constexpr double kExposureUnitMs = 0.1;  // of V4L2_CID_EXPOSURE_ABSOLUTE
constexpr std::int32_t kExposureUnitUs = 100;

/// A control as the driver describes it; nothing when there is none of this id.
///
/// @param id  with V4L2_CTRL_FLAG_NEXT_CTRL the one after it.
std::optional<v4l2_queryctrl> Describe(V4l2System& system, int fd, std::uint32_t id) {
  v4l2_queryctrl control{};
  control.id = id;
  if (system.Ioctl(fd, VIDIOC_QUERYCTRL, &control) != 0) return std::nullopt;
  return control;
}

bool IsUsable(const v4l2_queryctrl& control) {
  return (control.flags & V4L2_CTRL_FLAG_DISABLED) == 0 &&
         control.type != V4L2_CTRL_TYPE_CTRL_CLASS;
}

std::string NameOf(const v4l2_queryctrl& control) {
  const auto* name = reinterpret_cast<const char*>(control.name);
  return ControlKey(std::string_view(name, ::strnlen(name, sizeof(control.name))));
}

/// All controls, in the driver's order.
std::vector<v4l2_queryctrl> AllControls(V4l2System& system, int fd) {
  constexpr std::size_t kMost = 1000;  // a driver that never ends must not hold us
  std::vector<v4l2_queryctrl> controls;
  auto control = Describe(system, fd, V4L2_CTRL_FLAG_NEXT_CTRL);
  for (; control && controls.size() < kMost;
       control = Describe(system, fd, control->id | V4L2_CTRL_FLAG_NEXT_CTRL)) {
    if (IsUsable(*control)) controls.push_back(*control);
  }
  return controls;
}

/// The choices of a menu that the driver offers.
std::vector<std::int32_t> MenuChoices(V4l2System& system, int fd, const v4l2_queryctrl& control) {
  std::vector<std::int32_t> choices;
  for (std::int32_t value = control.minimum; value <= control.maximum; ++value) {
    v4l2_querymenu choice{};
    choice.id = control.id;
    choice.index = static_cast<std::uint32_t>(value);
    if (system.Ioctl(fd, VIDIOC_QUERYMENU, &choice) == 0) choices.push_back(value);
  }
  return choices;
}

std::string RangeText(const v4l2_queryctrl& control, double unit = 1.0) {
  std::string text = fmt::format("[{:g}, {:g}]", control.minimum * unit, control.maximum * unit);
  if (control.step > 1) text += fmt::format(" by {:g}", control.step * unit);
  return text;
}

/// The nearest value that the control can have. Menus have gaps, which the driver refuses itself.
std::int32_t NearestAllowed(const v4l2_queryctrl& control, std::int64_t wanted) {
  const std::int64_t low = control.minimum;
  const std::int64_t high = std::max<std::int64_t>(low, control.maximum);
  const std::int64_t step = std::max(1, control.step);
  const std::int64_t steps = (std::clamp(wanted, low, high) - low + step / 2) / step;
  const std::int64_t value = low + steps * step;
  return static_cast<std::int32_t>(value <= high ? value : value - step);
}

/// A word of the config for one or several choices of a menu, of which cameras offer one.
struct MenuWord {
  std::string_view word;
  std::vector<std::int32_t> values;
};

const std::vector<MenuWord>& ExposureWords() {
  static const std::vector<MenuWord> words{
      {"auto", {V4L2_EXPOSURE_AUTO, V4L2_EXPOSURE_APERTURE_PRIORITY}},
      {"manual", {V4L2_EXPOSURE_MANUAL, V4L2_EXPOSURE_SHUTTER_PRIORITY}}};
  return words;
}

const std::vector<MenuWord>& PowerLineWords() {
  static const std::vector<MenuWord> words{{"off", {V4L2_CID_POWER_LINE_FREQUENCY_DISABLED}},
                                           {"50", {V4L2_CID_POWER_LINE_FREQUENCY_50HZ}},
                                           {"60", {V4L2_CID_POWER_LINE_FREQUENCY_60HZ}},
                                           {"auto", {V4L2_CID_POWER_LINE_FREQUENCY_AUTO}}};
  return words;
}

std::string WordOf(const std::vector<MenuWord>& words, std::int32_t value) {
  const auto found = std::ranges::find_if(
      words, [&](const MenuWord& word) { return std::ranges::count(word.values, value) > 0; });
  return found == words.end() ? std::to_string(value) : std::string(found->word);
}

/// Sets one control after the other, and keeps what came of each.
class ControlSetter {
 public:
  ControlSetter(V4l2System& system, int fd) : system_(system), fd_(fd) {}

  [[nodiscard]] std::optional<v4l2_queryctrl> Find(std::uint32_t id) const {
    auto control = Describe(system_, fd_, id);
    if (!control || !IsUsable(*control)) return std::nullopt;
    return control;
  }

  [[nodiscard]] std::optional<std::int32_t> Get(std::uint32_t id) const {
    v4l2_control control{};
    control.id = id;
    if (system_.Ioctl(fd_, VIDIOC_G_CTRL, &control) != 0) return std::nullopt;
    return control.value;
  }

  void Lacks(std::string_view name) {
    report_.otherwise.push_back(fmt::format("it has no {}", name));
  }

  /// Sets a control that the device has, in units of `unit`, and reads it back.
  void Set(std::string_view name, const v4l2_queryctrl& control, double wanted, double unit = 1.0) {
    const std::int64_t asked = std::llround(wanted / unit);
    const auto given = SetAndGet(name, control.id, NearestAllowed(control, asked));
    if (!given) return;
    const double value = *given * unit;
    if (*given == asked) {
      report_.given.push_back(fmt::format("{} {:g}", name, value));
      return;
    }
    report_.otherwise.push_back(fmt::format(
        "{} is {:g}, asked for {:g}, allowed {}", name, value, wanted, RangeText(control, unit)));
  }

  /// Sets a menu to the first choice that the word stands for and the device offers.
  void SetMenu(std::string_view name,
               std::uint32_t id,
               const std::string& word,
               const std::vector<MenuWord>& words) {
    const auto control = Find(id);
    if (!control) return Lacks(name);
    const auto choices = MenuChoices(system_, fd_, *control);
    const auto wanted = std::ranges::find(words, word, &MenuWord::word);
    const auto choice = std::ranges::find_if(
        wanted->values, [&](std::int32_t value) { return std::ranges::count(choices, value) > 0; });
    if (choice == wanted->values.end()) {
      std::vector<std::string> offered;
      offered.reserve(choices.size());
      for (const std::int32_t value : choices)
        offered.push_back(WordOf(words, value));
      report_.otherwise.push_back(
          fmt::format("{} cannot be {}, allowed {}", name, word, fmt::join(offered, ", ")));
      return;
    }
    const auto given = SetAndGet(name, id, *choice);
    if (!given) return;
    if (*given == *choice) {
      report_.given.push_back(fmt::format("{} {}", name, word));
    } else {
      report_.otherwise.push_back(
          fmt::format("{} is {}, asked for {}", name, WordOf(words, *given), word));
    }
  }

  void Note(std::string text) { report_.given.push_back(std::move(text)); }
  void SetExposure(std::int32_t exposure_us) { report_.exposure_us = exposure_us; }
  V4l2ControlsReport Take() { return std::move(report_); }

 private:
  std::optional<std::int32_t> SetAndGet(std::string_view name,
                                        std::uint32_t id,
                                        std::int32_t value) {
    v4l2_control control{};
    control.id = id;
    control.value = value;
    if (system_.Ioctl(fd_, VIDIOC_S_CTRL, &control) != 0) {
      report_.otherwise.push_back(
          fmt::format("setting {} to {}: {}", name, value, std::generic_category().message(errno)));
      return std::nullopt;
    }
    return Get(id).value_or(control.value);  // some can only be written
  }

  V4l2System& system_;
  int fd_;
  V4l2ControlsReport report_;
};

void ApplyExposure(const CameraControlsConfig& config, ControlSetter& setter) {
  if (config.exposure == "unchanged") return;
  setter.SetMenu("exposure", V4L2_CID_EXPOSURE_AUTO, config.exposure, ExposureWords());
  if (config.exposure != "manual") return;
  const auto time = setter.Find(V4L2_CID_EXPOSURE_ABSOLUTE);
  if (!time) return setter.Lacks("exposure time");
  setter.Set("exposure_time_ms", *time, config.exposure_time_ms, kExposureUnitMs);
}

void ApplyGain(int gain, ControlSetter& setter) {
  if (gain < 0) return;
  if (const auto automatic = setter.Find(V4L2_CID_AUTOGAIN)) setter.Set("autogain", *automatic, 0);
  const auto control = setter.Find(V4L2_CID_GAIN);
  if (!control) return setter.Lacks("gain");
  setter.Set("gain", *control, gain);
}

/// Most cameras choose it themselves, and the config has it for the others, and for what is encoded
/// here: so it is no fault of a camera to have none.
void ApplyQuality(int quality, ControlSetter& setter) {
  const auto control = setter.Find(V4L2_CID_JPEG_COMPRESSION_QUALITY);
  if (!control) return setter.Note("jpeg_quality is the camera's own");
  setter.Set("jpeg_quality", *control, quality);
}

void ApplyOthers(const std::map<std::string, int>& others,
                 const std::vector<v4l2_queryctrl>& controls,
                 ControlSetter& setter) {
  for (const auto& [name, value] : others) {
    const auto found = std::ranges::find(controls, name, NameOf);
    if (found == controls.end()) {
      setter.Lacks(fmt::format("control '{}'", name));
    } else {
      setter.Set(name, *found, value);
    }
  }
}

/// Once: with automatic exposure each reading would be a transfer over USB.
void ReadExposure(ControlSetter& setter) {
  const std::int32_t mode = setter.Get(V4L2_CID_EXPOSURE_AUTO).value_or(V4L2_EXPOSURE_AUTO);
  if (WordOf(ExposureWords(), mode) != "manual") return;
  const auto exposure = setter.Get(V4L2_CID_EXPOSURE_ABSOLUTE);
  constexpr std::int32_t kLongest = 100'000;  // 10 s: more is not an exposure
  if (!exposure || *exposure < 0 || *exposure > kLongest) return;
  setter.SetExposure(*exposure * kExposureUnitUs);
}

}  // namespace

V4l2ControlsReport ApplyControls(V4l2System& system,
                                 int fd,
                                 const CameraConfig& config,
                                 std::uint32_t fourcc) {
  ControlSetter setter(system, fd);
  const CameraControlsConfig& controls = config.controls;
  ApplyExposure(controls, setter);
  ApplyGain(controls.gain, setter);
  if (controls.power_line_frequency != "unchanged") {
    setter.SetMenu("power_line_frequency",
                   V4L2_CID_POWER_LINE_FREQUENCY,
                   controls.power_line_frequency,
                   PowerLineWords());
  }
  if (fourcc == kFourccMjpeg) ApplyQuality(config.jpeg_quality, setter);
  if (!controls.others.empty()) ApplyOthers(controls.others, AllControls(system, fd), setter);
  ReadExposure(setter);
  return setter.Take();
}

std::vector<std::string> ListControls(V4l2System& system, int fd) {
  const auto controls = AllControls(system, fd);
  std::vector<std::string> texts;
  texts.reserve(controls.size());
  for (const v4l2_queryctrl& control : controls)
    texts.push_back(fmt::format("{} {}", NameOf(control), RangeText(control)));
  return texts;
}

std::string ControlKey(std::string_view name) {
  std::string key;
  bool is_between = false;
  for (const char character : name) {
    const auto letter = static_cast<unsigned char>(character);
    if (std::isalnum(letter) == 0) {
      is_between = !key.empty();
      continue;
    }
    if (is_between) key += '_';
    is_between = false;
    key += static_cast<char>(std::tolower(letter));
  }
  return key;
}

}  // namespace relocd
