#pragma once

#include <chrono>
#include <string>
#include <string_view>

namespace relocd {

/// A line on stderr that shows how far something is and when it will be done, while stderr is a
/// terminal; otherwise nothing.
class ProgressLine {
 public:
  explicit ProgressLine(std::string label);
  ~ProgressLine();
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;
  ProgressLine(ProgressLine&&) = delete;
  ProgressLine& operator=(ProgressLine&&) = delete;

  /// @param done  in [0, 1].
  void Show(double done, std::string_view detail);

 private:
  std::string label_;
  bool is_terminal_;
  bool has_shown_ = false;
  double done_before_ = -1.0;  ///< At the first call: what goes on was begun earlier.
  std::chrono::steady_clock::time_point start_;
  std::chrono::steady_clock::time_point last_;
};

}  // namespace relocd
