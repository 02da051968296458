#include "core/parse_number.h"

#include <charconv>

namespace relocd {
namespace {

template <typename Number>
std::optional<Number> Parse(std::string_view text) {
  text = Trim(text);
  if (text.starts_with('+')) text.remove_prefix(1);
  Number value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

}  // namespace

std::string_view Trim(std::string_view text) {
  constexpr std::string_view kBlanks = " \t\r\n";
  const auto first = text.find_first_not_of(kBlanks);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlanks) - first + 1);
}

std::optional<double> ParseDouble(std::string_view text) {
  return Parse<double>(text);
}

std::optional<std::int64_t> ParseInt64(std::string_view text) {
  return Parse<std::int64_t>(text);
}

}  // namespace relocd
