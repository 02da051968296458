#include "config/config.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <string_view>
#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "config/yaml_reader.h"
#include "config/yaml_writer.h"
#include "core/file.h"
#include "core/sha256.h"

namespace relocd {
namespace {

/// The part of an udpm url that tells networks apart.
std::string_view PortOf(std::string_view url) {
  const auto query = url.find('?');
  url = url.substr(0, query);
  const auto colon = url.rfind(':');
  return colon == std::string_view::npos ? url : url.substr(colon + 1);
}

/// Puts file and line before a message of Validate(), which begins with the key's full name.
Error Locate(Error error, const std::string& path, const YamlReader::Lines& lines) {
  std::string key = error.message.substr(0, error.message.find(' '));
  while (!key.empty()) {
    if (const auto found = lines.find(key); found != lines.end()) {
      const std::string where =
          found->second == 0 ? "--set" : fmt::format("{}: line {}", path, found->second);
      return std::move(error).WithContext(where);
    }
    const auto dot = key.rfind('.');
    key.resize(dot == std::string::npos ? 0 : dot);
  }
  return std::move(error).WithContext(path);
}

/// Paths in a config are relative to its folder.
void CompletePath(const std::filesystem::path& directory, std::string& path) {
  if (!path.empty()) path = (directory / path).lexically_normal().string();
}

void CompletePaths(const std::filesystem::path& directory, Config& config) {
  for (auto& [name, camera] : config.cameras)
    CompletePath(directory, camera.file.dataset);
  CompletePath(directory, config.can.path);
  CompletePath(directory, config.can.dbc_file);
  CompletePath(directory, config.inference.map_path);
  CompletePath(directory, config.localization.state_file);
  CompletePath(directory, config.recorder.directory);
}

/// The name becomes part of a channel's.
Result<void> CheckCameraName(const std::string& name) {
  const bool valid = !name.empty() && std::all_of(name.begin(), name.end(), [](char letter) {
    return std::isalnum(static_cast<unsigned char>(letter)) != 0 || letter == '_';
  });
  if (valid) return {};
  return Error{ErrorKind::kInvalidInput,
               fmt::format("cameras.{} has a name that is not of letters, digits and _", name)};
}

}  // namespace

Result<void> BusConfig::Validate() const {
  const bool multicast = control_url.starts_with("udpm://") && image_url.starts_with("udpm://");
  if (multicast && PortOf(control_url) == PortOf(image_url)) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("image_url has port {} as control_url has, must have another",
                             PortOf(image_url))};
  }
  return {};
}

std::map<std::string, Pose3> Config::CameraMountings() const {
  std::map<std::string, Pose3> X_BCs;
  for (const auto& [name, camera] : cameras) {
    X_BCs.emplace(name, camera.X_BC());
  }
  return X_BCs;
}

Result<void> Config::Validate() const {
  const auto check = [](const std::string& section, const auto& config) -> Result<void> {
    auto ok = config.Validate();
    if (ok) return ok;
    const Error error = std::move(ok).error();
    return Error{error.kind, fmt::format("{}.{}", section, error.message)};
  };
  if (auto ok = check("bus", bus); !ok) return ok;
  for (const auto& [name, camera] : cameras) {
    if (auto ok = CheckCameraName(name); !ok) return ok;
    if (auto ok = check("cameras." + name, camera); !ok) return ok;
  }
  if (auto ok = check("can", can); !ok) return ok;
  if (auto ok = check("odometry", odometry); !ok) return ok;
  if (auto ok = check("inference", inference); !ok) return ok;
  if (auto ok = check("localization", localization); !ok) return ok;
  if (auto ok = check("recorder", recorder); !ok) return ok;
  return check("supervisor", supervisor);
}

Result<Config> LoadConfig(const std::string& path, const std::vector<std::string>& overrides) {
  auto text = path.empty() ? Result<std::string>(std::string()) : ReadFile(path);
  if (!text) return std::move(text).error();
  Config config;
  auto lines = YamlReader::ReadText(*text, path, overrides, config);
  if (!lines) return std::move(lines).error();
  for (const std::string& text_override : overrides) {
    (*lines)[text_override.substr(0, text_override.find('='))] = 0;
  }
  if (auto ok = config.Validate(); !ok) return Locate(std::move(ok).error(), path, *lines);
  std::error_code no_error;  // a path that cannot be made absolute stays as it is
  CompletePaths(std::filesystem::absolute(path, no_error).parent_path(), config);
  return config;
}

std::string FormatConfig(const Config& config) {
  return YamlWriter::Write(config);
}

std::string ConfigHash(const Config& config) {
  constexpr std::size_t kDigits = 16;
  return Sha256Hex(FormatConfig(config)).substr(0, kDigits);
}

}  // namespace relocd
