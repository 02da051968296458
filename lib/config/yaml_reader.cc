#include "config/yaml_reader.h"

#include <algorithm>
#include <limits>
#include <set>
#include <string_view>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "core/nearest_name.h"
#include "core/parse_number.h"

namespace relocd {
namespace {

constexpr std::size_t kMaxFileSize = 1 << 20;

Result<void> ApplyOverride(const std::string& text, const YAML::Node& root) {
  const auto equals = text.find('=');
  if (equals == std::string::npos || equals == 0) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("--set {}: must be as in odometry.track_m=0.5", text)};
  }
  std::string_view keys = text;
  keys = keys.substr(0, equals);
  YAML::Node node = root;  // a handle: what is put into it is in the root
  while (true) {
    const auto dot = keys.find('.');
    const std::string key(keys.substr(0, dot));
    if (dot == std::string_view::npos) {
      const std::string value = text.substr(equals + 1);
      const YAML::Node parsed = value.empty() ? YAML::Node("") : YAML::Load(value);
      // As a node of its own it is in no line, and an error in it is not said to be in the file's.
      node[key] = parsed.IsScalar() ? YAML::Node(parsed.Scalar()) : parsed;
      return {};
    }
    if (!node[key].IsDefined() || node[key].IsNull()) node[key] = YAML::Node(YAML::NodeType::Map);
    if (!node[key].IsMap()) {
      return Error{ErrorKind::kInvalidInput,
                   fmt::format("--set {}: '{}' is a value, must be a section", text, key)};
    }
    node.reset(node[key]);
    keys.remove_prefix(dot + 1);
  }
}

}  // namespace

Result<YAML::Node> YamlReader::ParseDocument(const std::string& text,
                                             const std::string& path,
                                             const std::vector<std::string>& overrides) {
  if (text.size() > kMaxFileSize) {
    return Error{
        ErrorKind::kInvalidInput,
        fmt::format("{}: has {} bytes, must have at most {}", path, text.size(), kMaxFileSize)};
  }
  try {
    YAML::Node root = YAML::Load(text);
    if (root.IsNull()) root = YAML::Node(YAML::NodeType::Map);
    if (!root.IsMap()) {
      return Error{
          ErrorKind::kInvalidInput,
          fmt::format("{}: line 1: is no YAML mapping, must have sections with keys", path)};
    }
    for (const std::string& text_override : overrides) {
      if (auto ok = ApplyOverride(text_override, root); !ok) return std::move(ok).error();
    }
    return root;
  } catch (const YAML::Exception& exception) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("{}: line {}: {}", path, exception.mark.line + 1, exception.msg)};
  }
}

void YamlReader::CheckKeys(const YAML::Node& node,
                           const std::string& key,
                           const std::vector<std::string>* known) {
  std::set<std::string> seen;
  for (const auto& entry : node) {
    if (error_) return;
    if (!entry.first.IsScalar()) return Fail(entry.first, key, "a name before the colon");
    const std::string name = entry.first.Scalar();
    if (!seen.insert(name).second) {
      error_ =
          Error{ErrorKind::kInvalidInput,
                fmt::format("{}: key '{}' is given twice", Where(entry.first), Join(key, name))};
      return;
    }
    if (known == nullptr || std::find(known->begin(), known->end(), name) != known->end()) continue;
    const std::string nearest = NearestName(name, *known);
    error_ = Error{ErrorKind::kInvalidInput,
                   fmt::format("{}: unknown key '{}', {}expected one of {}",
                               Where(entry.first),
                               Join(key, name),
                               nearest.empty() ? "" : fmt::format("did you mean '{}'? ", nearest),
                               fmt::join(*known, ", "))};
    return;
  }
}

void YamlReader::Read(const YAML::Node& node, const std::string& key, bool& value) {
  if (error_) return;
  const std::string text = node.IsScalar() ? node.Scalar() : "";
  if (text != "true" && text != "false") return Fail(node, key, "true or false");
  value = text == "true";
}

void YamlReader::Read(const YAML::Node& node, const std::string& key, int& value) {
  std::int64_t wide = value;
  Read(node, key, wide);
  if (error_) return;
  if (wide < std::numeric_limits<int>::min() || wide > std::numeric_limits<int>::max()) {
    return Fail(node, key, "an integer of 32 bits");
  }
  value = static_cast<int>(wide);
}

void YamlReader::Read(const YAML::Node& node, const std::string& key, std::int64_t& value) {
  if (error_) return;
  const auto parsed = node.IsScalar() ? ParseInt64(node.Scalar()) : std::nullopt;
  if (!parsed) return Fail(node, key, "an integer");
  value = *parsed;
}

void YamlReader::Read(const YAML::Node& node, const std::string& key, double& value) {
  if (error_) return;
  const auto parsed = node.IsScalar() ? ParseDouble(node.Scalar()) : std::nullopt;
  if (!parsed) return Fail(node, key, "a number");
  value = *parsed;
}

void YamlReader::Read(const YAML::Node& node, const std::string& key, std::string& value) {
  if (error_) return;
  if (!node.IsScalar()) return Fail(node, key, "a text");
  value = node.Scalar();
}

void YamlReader::Fail(const YAML::Node& node, const std::string& key, const std::string& allowed) {
  const std::string found = node.IsScalar()     ? fmt::format("'{}'", node.Scalar())
                            : node.IsMap()      ? "a section"
                            : node.IsSequence() ? fmt::format("a list of {}", node.size())
                                                : "empty";
  error_ = Error{ErrorKind::kInvalidInput,
                 fmt::format("{}: {} is {}, must be {}", Where(node), key, found, allowed)};
}

std::string YamlReader::Where(const YAML::Node& node) const {
  if (node.Mark().line < 0) return path_.empty() ? "--set" : fmt::format("{}: --set", path_);
  return fmt::format("{}: line {}", path_, node.Mark().line + 1);
}

std::string YamlReader::Join(const std::string& key, const std::string& name) {
  return key.empty() ? name : key + "." + name;
}

}  // namespace relocd
