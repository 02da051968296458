#include "progress_line.h"

#include <unistd.h>

#include <cstdio>
#include <utility>

#include <fmt/core.h>

namespace relocd {
namespace {

constexpr std::chrono::milliseconds kInterval{200};

}  // namespace

ProgressLine::ProgressLine(std::string label)
    : label_(std::move(label)),
      is_terminal_(isatty(STDERR_FILENO) == 1),
      start_(std::chrono::steady_clock::now()),
      last_(start_ - kInterval) {}

ProgressLine::~ProgressLine() {
  if (has_shown_) fmt::print(stderr, "\n");
}

void ProgressLine::Show(double done, std::string_view detail) {
  const auto now = std::chrono::steady_clock::now();
  if (done_before_ < 0.0) done_before_ = done;
  if (!is_terminal_ || (done < 1.0 && now - last_ < kInterval)) return;
  last_ = now;
  has_shown_ = true;
  const double elapsed_s = std::chrono::duration<double>(now - start_).count();
  const double since = done - done_before_;
  const double left_s = since > 0.0 ? elapsed_s * (1.0 - done) / since : 0.0;
  // Back to the line's begin, and clear what is longer from before.
  fmt::print(
      stderr, "\r\033[K{}: {:3.0f} %, {:.0f} s left  {}", label_, 100.0 * done, left_s, detail);
  std::fflush(stderr);
}

}  // namespace relocd
