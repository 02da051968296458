#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <yaml-cpp/yaml.h>

#include "core/result.h"

namespace relocd {

/// Whether T is a config struct: it lists its fields for a visitor.
template <typename T>
concept ConfigStruct = requires(T& value) {
  T::VisitFields(value, [](const char*, auto&, const char*) {});
};

/// Reads YAML into config structs. A key that is missing keeps its default; a key that no struct
/// has, one given twice, and a value of another type are errors that name file, line, key, value
/// and what is allowed.
///
/// The one place that knows yaml-cpp, whose exceptions end here.
class YamlReader {
 public:
  /// The line, counted from 1, of each key that the text gives, by its full name:
  /// `odometry.track_m`.
  using Lines = std::map<std::string, int>;

  /// @return kInvalidInput.
  template <ConfigStruct Config>
  static Result<Lines> ReadText(const std::string& text,
                                const std::string& path,
                                const std::vector<std::string>& overrides,
                                Config& config) {
    auto root = ParseDocument(text, path, overrides);
    if (!root) return std::move(root).error();
    YamlReader reader(path);
    reader.ReadStruct(*root, "", config);
    if (reader.error_) return *std::move(reader.error_);
    return std::move(reader.lines_);
  }

 private:
  explicit YamlReader(std::string path) : path_(std::move(path)) {}

  /// @param overrides  `key.of.field=value`, put over the file's.
  static Result<YAML::Node> ParseDocument(const std::string& text,
                                          const std::string& path,
                                          const std::vector<std::string>& overrides);

  template <ConfigStruct Config>
  void ReadStruct(const YAML::Node& node, const std::string& key, Config& config) {
    if (error_ || node.IsNull()) return;  // an empty section keeps its defaults
    if (!node.IsMap()) return Fail(node, key, "a section with keys");
    std::vector<std::string> known;
    Config::VisitFields(config, [&](const char* name, auto& field, const char* /*comment*/) {
      known.emplace_back(name);
      const YAML::Node child = node[name];
      if (!child.IsDefined()) return;
      lines_[Join(key, name)] = child.Mark().line + 1;
      Read(child, Join(key, name), field);
    });
    CheckKeys(node, key, &known);
  }

  template <ConfigStruct Config>
  void Read(const YAML::Node& node, const std::string& key, Config& config) {
    ReadStruct(node, key, config);
  }

  template <typename Value>
  void Read(const YAML::Node& node, const std::string& key, std::map<std::string, Value>& values) {
    if (error_) return;
    values.clear();
    if (node.IsNull()) return;
    if (!node.IsMap()) return Fail(node, key, "a section with one key for each name");
    CheckKeys(node, key, nullptr);
    for (const auto& entry : node) {
      if (error_) return;
      const std::string name = entry.first.Scalar();
      Read(entry.second, Join(key, name), values[name]);
    }
  }

  template <typename Value>
  void Read(const YAML::Node& node, const std::string& key, std::vector<Value>& values) {
    if (error_) return;
    if (!node.IsSequence()) return Fail(node, key, "a list");
    values.clear();
    for (const auto& element : node) {
      Value value{};
      Read(element, key, value);
      values.push_back(std::move(value));
    }
  }

  template <std::size_t kSize>
  void Read(const YAML::Node& node, const std::string& key, std::array<double, kSize>& values) {
    if (error_) return;
    if (!node.IsSequence() || node.size() != kSize) {
      return Fail(node, key, "a list of " + std::to_string(kSize) + " numbers");
    }
    for (std::size_t i = 0; i < kSize; ++i)
      Read(node[i], key, values[i]);
  }

  void Read(const YAML::Node& node, const std::string& key, bool& value);
  void Read(const YAML::Node& node, const std::string& key, int& value);
  void Read(const YAML::Node& node, const std::string& key, std::int64_t& value);
  void Read(const YAML::Node& node, const std::string& key, double& value);
  void Read(const YAML::Node& node, const std::string& key, std::string& value);

  /// Refuses keys that are not scalars, are given twice, or are not among `known`.
  void CheckKeys(const YAML::Node& node,
                 const std::string& key,
                 const std::vector<std::string>* known);
  void Fail(const YAML::Node& node, const std::string& key, const std::string& allowed);
  [[nodiscard]] std::string Where(const YAML::Node& node) const;
  static std::string Join(const std::string& key, const std::string& name);

  std::string path_;
  std::optional<Error> error_;  ///< The first one.
  Lines lines_;
};

}  // namespace relocd
