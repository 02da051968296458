#include "relocd/config_sections.h"

#include <algorithm>
#include <array>

#include <fmt/format.h>

#include "config/yaml_writer.h"

namespace relocd {
namespace {

constexpr std::string_view kCameraDaemon = "camerad_";

/// Which daemon reads a section, where it is one alone.
struct SectionReader {
  std::string_view section;
  std::string_view daemon;
};
constexpr std::array<SectionReader, 6> kReaders{{
    {"can", "odometryd"},
    {"odometry", "odometryd"},
    {"inference", "inferenced"},
    {"recorder", "recorderd"},
    {"localization", "smootherd"},
    {"supervisor", ""},
}};

template <ConfigStruct Section>
std::string TextOf(const Section& section) {
  return YamlWriter::Write(section);
}

template <typename Value>
std::string TextOf(const std::map<std::string, Value>& sections) {
  std::string text;
  for (const auto& [name, section] : sections)
    text += fmt::format("{}:\n{}", name, TextOf(section));
  return text;
}

bool IsDaemon(std::string_view process) {
  constexpr std::array<std::string_view, 4> kDaemons{
      "recorderd", "smootherd", "inferenced", "odometryd"};
  return std::find(kDaemons.begin(), kDaemons.end(), process) != kDaemons.end() ||
         process.starts_with(kCameraDaemon);
}

bool Concerns(std::string_view section, std::string_view process) {
  // A camerad reads its own camera only.
  if (section == "cameras") return process == "inferenced" || process == "smootherd";
  const auto reader = std::find_if(kReaders.begin(), kReaders.end(), [&](const auto& entry) {
    return entry.section == section;
  });
  return reader == kReaders.end() || reader->daemon == process;
}

}  // namespace

ConfigSections::ConfigSections(const Config& config) {
  Config::VisitFields(config, [this](const char* name, const auto& section, const char*) {
    sections_[name] = TextOf(section);
  });
  for (const auto& [name, camera] : config.cameras)
    cameras_[name] = TextOf(camera);
}

std::vector<std::string> ConfigSections::CameraNames() const {
  std::vector<std::string> names;
  for (const auto& [name, text] : cameras_)
    names.push_back(name);
  return names;
}

std::string ConfigSections::ReadBy(std::string_view process) const {
  std::string read;
  if (!IsDaemon(process)) return read;
  for (const auto& [name, text] : sections_) {
    if (Concerns(name, process)) read += fmt::format("{}:\n{}", name, text);
  }
  if (process.starts_with(kCameraDaemon)) {
    const auto camera = cameras_.find(std::string(process.substr(kCameraDaemon.size())));
    if (camera != cameras_.end()) read += camera->second;
  }
  return read;
}

}  // namespace relocd
