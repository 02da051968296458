#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "config/yaml_reader.h"

namespace relocd {

/// Prints a config struct as YAML with every key, each with its comment: what YamlReader reads back
/// to the same struct.
class YamlWriter {
 public:
  template <ConfigStruct Config>
  static std::string Write(const Config& config) {
    YamlWriter writer;
    writer.WriteStruct(config, 0);
    return writer.text_;
  }

 private:
  template <ConfigStruct Config>
  void WriteStruct(const Config& config, int depth) {
    Config::VisitFields(config, [&](const char* name, const auto& field, const char* comment) {
      WriteField(name, field, comment, depth);
    });
  }

  template <typename Field>
  void WriteField(const std::string& name,
                  const Field& field,
                  const std::string& comment,
                  int depth) {
    if constexpr (ConfigStruct<Field>) {
      BeginSection(name, comment, depth);
      WriteStruct(field, depth + 1);
    } else {
      WriteLine(name, Format(field), comment, depth);
    }
  }

  template <typename Value>
  void WriteField(const std::string& name,
                  const std::map<std::string, Value>& values,
                  const std::string& comment,
                  int depth) {
    if (values.empty()) return WriteLine(name, "{}", comment, depth);
    BeginSection(name, comment, depth);
    for (const auto& [key, value] : values)
      WriteField(key, value, "", depth + 1);
  }

  static std::string Format(bool value);
  static std::string Format(int value);
  static std::string Format(std::int64_t value);
  static std::string Format(double value);
  static std::string Format(const std::string& value);

  template <typename Value>
  static std::string Format(const std::vector<Value>& values) {
    return FormatList(values);
  }
  template <std::size_t kSize>
  static std::string Format(const std::array<double, kSize>& values) {
    return FormatList(values);
  }
  template <typename List>
  static std::string FormatList(const List& values) {
    std::string text = "[";
    for (const auto& value : values) {
      if (text.size() > 1) text += ", ";
      text += Format(value);
    }
    return text + "]";
  }

  void BeginSection(const std::string& name, const std::string& comment, int depth);
  void WriteLine(const std::string& name,
                 const std::string& value,
                 const std::string& comment,
                 int depth);

  std::string text_;
};

}  // namespace relocd
