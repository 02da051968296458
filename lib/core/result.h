#pragma once

#include <optional>
#include <utility>
#include <variant>

#include "core/check.h"
#include "core/error.h"

namespace relocd {

/// Either a value, or the reason why there is none.
///
/// The names are those of C++23's std::expected, which g++ 12 has only as C++23 and clang-tidy 14
/// cannot read, so that one alias can replace this file one day.
template <typename T>
class [[nodiscard]] Result {
 public:
  Result(T value) : state_(std::move(value)) {}      // NOLINT(google-explicit-constructor)
  Result(Error error) : state_(std::move(error)) {}  // NOLINT(google-explicit-constructor)

  [[nodiscard]] bool has_value() const { return std::holds_alternative<T>(state_); }
  explicit operator bool() const { return has_value(); }

  /// The value. Calling this without one is a bug, and ends the process.
  [[nodiscard]] T& value() & {
    RELOCD_CHECK(has_value(), "value() of a failed Result");
    return *std::get_if<T>(&state_);
  }
  [[nodiscard]] const T& value() const& {
    RELOCD_CHECK(has_value(), "value() of a failed Result");
    return *std::get_if<T>(&state_);
  }
  [[nodiscard]] T value() && { return std::move(value()); }

  [[nodiscard]] const Error& error() const& {
    RELOCD_CHECK(!has_value(), "error() of a successful Result");
    return *std::get_if<Error>(&state_);
  }
  [[nodiscard]] Error error() && {
    RELOCD_CHECK(!has_value(), "error() of a successful Result");
    return std::move(*std::get_if<Error>(&state_));
  }

  T& operator*() & { return value(); }
  const T& operator*() const& { return value(); }
  T* operator->() { return &value(); }
  const T* operator->() const { return &value(); }

 private:
  std::variant<T, Error> state_;
};

/// Success, or the reason for the failure.
template <>
class [[nodiscard]] Result<void> {
 public:
  Result() = default;
  Result(Error error) : error_(std::move(error)) {}  // NOLINT(google-explicit-constructor)

  [[nodiscard]] bool has_value() const { return !error_.has_value(); }
  explicit operator bool() const { return has_value(); }

  [[nodiscard]] const Error& error() const& {
    RELOCD_CHECK(!has_value(), "error() of a successful Result");
    return *error_;
  }
  [[nodiscard]] Error error() && {
    RELOCD_CHECK(!has_value(), "error() of a successful Result");
    return std::move(*error_);
  }

 private:
  std::optional<Error> error_;
};

}  // namespace relocd
