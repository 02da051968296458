#include "config/yaml_writer.h"

#include <algorithm>
#include <iterator>
#include <string_view>

#include <fmt/format.h>

namespace relocd {
namespace {

constexpr int kIndent = 2;
constexpr std::size_t kCommentColumn = 36;
constexpr std::size_t kMaxColumn = 110;

/// Comment lines of at most kMaxColumn columns, broken between words.
std::string FormatComment(std::string_view comment, const std::string& indent) {
  std::string text;
  std::string line = indent + "#";
  while (!comment.empty()) {
    const auto space = std::min(comment.find(' '), comment.size());
    if (line.size() + 1 + space > kMaxColumn && line.size() > indent.size() + 1) {
      text += line + "\n";
      line = indent + "#";
    }
    line += ' ';
    line += comment.substr(0, space);
    comment.remove_prefix(std::min(space + 1, comment.size()));
  }
  return text + line + "\n";
}

}  // namespace

std::string YamlWriter::Format(bool value) {
  return value ? "true" : "false";
}
std::string YamlWriter::Format(int value) {
  return fmt::format("{}", value);
}
std::string YamlWriter::Format(std::int64_t value) {
  return fmt::format("{}", value);
}
std::string YamlWriter::Format(double value) {
  return fmt::format("{}", value);
}

std::string YamlWriter::Format(const std::string& value) {
  std::string text = "\"";
  for (const char character : value) {
    if (character == '"' || character == '\\') text += '\\';
    if (character == '\n') {
      text += "\\n";
    } else {
      text += character;
    }
  }
  return text + "\"";
}

void YamlWriter::BeginSection(const std::string& name, const std::string& comment, int depth) {
  if (depth == 0 && !text_.empty()) text_ += '\n';
  const std::string indent(static_cast<std::size_t>(depth * kIndent), ' ');
  if (!comment.empty()) text_ += FormatComment(comment, indent);
  fmt::format_to(std::back_inserter(text_), "{}{}:\n", indent, name);
}

void YamlWriter::WriteLine(const std::string& name,
                           const std::string& value,
                           const std::string& comment,
                           int depth) {
  const std::string indent(static_cast<std::size_t>(depth * kIndent), ' ');
  std::string line = indent + name + ": " + value;
  const std::size_t column = std::max(line.size() + 2, kCommentColumn);
  if (!comment.empty() && column + comment.size() <= kMaxColumn) {
    line.resize(column, ' ');
    line += "# " + comment;
  } else if (!comment.empty()) {
    text_ += FormatComment(comment, indent);
  }
  text_ += line + "\n";
}

}  // namespace relocd
