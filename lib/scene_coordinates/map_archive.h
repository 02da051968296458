#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <fmt/format.h>

#include "core/progress.h"
#include "core/result.h"

namespace relocd {

static_assert(std::endian::native == std::endian::little, "map files are little-endian");

/// Appends the fields of a map to a string. The counterpart of MapReader: one function visits a
/// map's fields with either, so that what is written is what is read.
class MapWriter {
 public:
  static constexpr bool kReads = false;

  /// A number of fixed size. The bounds are the reader's business.
  template <typename T>
  void Number(const char* /*field*/, const T& value, T /*low*/, T /*high*/) {
    static_assert(std::is_arithmetic_v<T>);
    Append(&value, sizeof(value));
  }

  void Text(const char* /*field*/, const std::string& text, std::uint32_t /*max_size*/) {
    const auto size = static_cast<std::uint32_t>(text.size());
    Append(&size, sizeof(size));
    Append(text.data(), text.size());
  }

  /// Floats, kept in half precision. Their number is known to both sides.
  void Halves(const char* /*field*/, const std::vector<float>& values, std::size_t count);

  [[nodiscard]] std::string TakeBytes() && { return std::move(bytes_); }

 private:
  void Append(const void* data, std::size_t size) {
    bytes_.append(static_cast<const char*>(data), size);
  }

  std::string bytes_;
};

/// Reads the fields of a map from bytes that may be anything. After the first thing that is wrong
/// it reads nothing more, and keeps the reason.
class MapReader {
 public:
  static constexpr bool kReads = true;

  /// @param progress  called after each array.
  MapReader(std::string_view bytes, Progress progress)
      : rest_(bytes), progress_(std::move(progress)) {}

  /// A number that must be in [low, high], which for floating point also excludes NaN.
  template <typename T>
  void Number(const char* field, T& value, T low, T high) {
    static_assert(std::is_arithmetic_v<T>);
    T read{};
    if (!Take(field, &read, sizeof(read))) return;
    if (!(read >= low && read <= high)) {
      Fail(fmt::format("{} is {}, must be in [{}, {}]", field, read, low, high));
      return;
    }
    value = read;
  }

  void Text(const char* field, std::string& text, std::uint32_t max_size);
  void Halves(const char* field, std::vector<float>& values, std::size_t count);

  void Fail(std::string message) {
    if (!error_) error_ = Error{ErrorKind::kInvalidInput, std::move(message)};
  }
  [[nodiscard]] bool failed() const { return error_.has_value(); }
  [[nodiscard]] const std::optional<Error>& error() const { return error_; }
  [[nodiscard]] std::size_t rest_size() const { return rest_.size(); }

 private:
  bool Take(const char* field, void* out, std::size_t size);

  std::string_view rest_;
  Progress progress_;
  std::optional<Error> error_;
};

}  // namespace relocd
