#pragma once

#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/result.h"

namespace relocd {

/// A table of comma-separated values under a header line. Lines that are empty or start with `#`
/// are passed over.
///
/// Every error names the file and the line.
class CsvTable {
 public:
  /// @return kInvalidInput when the file has no header, or a row has another number of cells than
  /// the header;
  ///         kUnavailable when it cannot be read.
  static Result<CsvTable> Read(const std::string& path);
  static Result<CsvTable> Parse(std::string_view text, const std::string& path);

  [[nodiscard]] std::size_t row_count() const { return lines_.size(); }
  [[nodiscard]] std::optional<std::size_t> FindColumn(std::string_view name) const;

  /// The columns with these names, in the order asked for.
  ///
  /// @return kInvalidInput, naming the missing column and the header that was found.
  [[nodiscard]] Result<std::vector<std::size_t>> Columns(
      std::initializer_list<std::string_view> names) const;

  /// A finite number. @return kInvalidInput, naming line, column and text.
  [[nodiscard]] Result<double> Double(std::size_t row, std::size_t column) const;
  [[nodiscard]] Result<std::int64_t> Int64(std::size_t row, std::size_t column) const;
  /// Nothing for an empty cell.
  [[nodiscard]] Result<std::optional<double>> OptionalDouble(std::size_t row,
                                                             std::size_t column) const;
  [[nodiscard]] const std::string& Text(std::size_t row, std::size_t column) const;

  /// `path: line 12`, to begin an error with.
  [[nodiscard]] std::string Where(std::size_t row) const;
  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  std::string path_;
  std::vector<std::string> header_;
  std::vector<std::size_t> lines_;  ///< Line number of each row, counted from 1.
  std::vector<std::string> cells_;  ///< Row-major.
};

}  // namespace relocd
