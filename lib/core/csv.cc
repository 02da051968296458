#include "core/csv.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "core/file.h"
#include "core/parse_number.h"

namespace relocd {
namespace {

std::vector<std::string> SplitCells(std::string_view line) {
  std::vector<std::string> cells;
  while (true) {
    const auto comma = line.find(',');
    cells.emplace_back(Trim(line.substr(0, comma)));
    if (comma == std::string_view::npos) return cells;
    line.remove_prefix(comma + 1);
  }
}

}  // namespace

Result<CsvTable> CsvTable::Read(const std::string& path) {
  auto text = ReadFile(path);
  if (!text) return std::move(text).error();
  return Parse(*text, path);
}

Result<CsvTable> CsvTable::Parse(std::string_view text, const std::string& path) {
  CsvTable table;
  table.path_ = path;
  for (std::size_t line_number = 1; !text.empty(); ++line_number) {
    const auto end = text.find('\n');
    const std::string_view line = Trim(text.substr(0, end));
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    if (line.empty() || line.starts_with('#')) continue;
    std::vector<std::string> cells = SplitCells(line);
    if (table.header_.empty()) {
      table.header_ = std::move(cells);
      continue;
    }
    if (cells.size() != table.header_.size()) {
      return Error{ErrorKind::kInvalidInput,
                   fmt::format("{}: line {}: has {} cells, must have {} as the header",
                               path,
                               line_number,
                               cells.size(),
                               table.header_.size())};
    }
    table.lines_.push_back(line_number);
    std::move(cells.begin(), cells.end(), std::back_inserter(table.cells_));
  }
  if (table.header_.empty()) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("{}: is empty, must have a header line", path)};
  }
  return table;
}

std::optional<std::size_t> CsvTable::FindColumn(std::string_view name) const {
  const auto found = std::find(header_.begin(), header_.end(), name);
  if (found == header_.end()) return std::nullopt;
  return static_cast<std::size_t>(found - header_.begin());
}

Result<std::vector<std::size_t>> CsvTable::Columns(
    std::initializer_list<std::string_view> names) const {
  std::vector<std::size_t> columns;
  for (const std::string_view name : names) {
    const auto column = FindColumn(name);
    if (!column) {
      return Error{ErrorKind::kInvalidInput,
                   fmt::format("{}: line 1: the header has no column '{}', it has {}",
                               path_,
                               name,
                               fmt::join(header_, ","))};
    }
    columns.push_back(*column);
  }
  return columns;
}

Result<double> CsvTable::Double(std::size_t row, std::size_t column) const {
  const auto value = ParseDouble(Text(row, column));
  if (!value || !std::isfinite(*value)) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("{}: {} is '{}', must be a finite number",
                             Where(row),
                             header_[column],
                             Text(row, column))};
  }
  return *value;
}

Result<std::int64_t> CsvTable::Int64(std::size_t row, std::size_t column) const {
  const auto value = ParseInt64(Text(row, column));
  if (!value) {
    return Error{
        ErrorKind::kInvalidInput,
        fmt::format(
            "{}: {} is '{}', must be an integer", Where(row), header_[column], Text(row, column))};
  }
  return *value;
}

Result<std::optional<double>> CsvTable::OptionalDouble(std::size_t row, std::size_t column) const {
  if (Text(row, column).empty()) return std::optional<double>();
  auto value = Double(row, column);
  if (!value) return std::move(value).error();
  return std::optional(*value);
}

const std::string& CsvTable::Text(std::size_t row, std::size_t column) const {
  return cells_[row * header_.size() + column];
}

std::string CsvTable::Where(std::size_t row) const {
  return fmt::format("{}: line {}", path_, lines_[row]);
}

}  // namespace relocd
