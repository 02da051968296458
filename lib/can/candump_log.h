#pragma once

#include <cstddef>
#include <cstdint>
#include <istream>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "can/can_frame.h"
#include "core/result.h"

namespace relocd {

/// One line of a candump log.
struct CandumpRecord {
  std::int64_t time_ns = 0;  ///< The recording's own clock.
  std::string interface {};
  CanFrame frame{};  ///< Its receive_time is `time_ns`.
};

/// Reads `(46408.584954) can0 0B4#000000001D0B7A5E`: time, interface, identifier in 3 (11 bits) or
/// 8 (29 bits) hexadecimal digits, `#` and the data. `#R` is a remote frame, `##` and a digit of
/// flags a CAN FD frame. Dots between bytes, and a last word `R` or `T`, are allowed.
///
/// @return kInvalidInput, saying which part is wrong.
Result<CandumpRecord> ParseCandumpLine(std::string_view line);

/// The line that ParseCandumpLine reads, with the time in whole microseconds as candump writes it.
std::string FormatCandumpLine(const CandumpRecord& record);

/// Reads what `candump -L` wrote, a line at a time.
class CandumpLog {
 public:
  /// @return kUnavailable when the file cannot be opened.
  static Result<CandumpLog> Open(const std::string& path);
  static CandumpLog FromText(std::string text, std::string path);

  /// The next frame, or nothing at the end. Empty lines and those that start with `#` are passed
  /// over. So is a last line without an end that is none, behind others: what a killed writer
  /// leaves.
  ///
  /// @return kInvalidInput with file and line for any other line that is none, and for a time
  ///         before that of the frame before it on the same interface.
  Result<std::optional<CandumpRecord>> Next();

  /// The next frame of `interface` that holds data: neither an error frame nor a remote one.
  ///
  /// @return as Next.
  Result<std::optional<CanFrame>> NextDataFrame(std::string_view interface);

  /// What of the log was no frame and left out so far, for a person; empty if nothing was.
  [[nodiscard]] std::string LeftOut() const;

 private:
  CandumpLog(std::unique_ptr<std::istream> stream, std::string path);

  Result<void> CheckOrder(const CandumpRecord& record);

  std::unique_ptr<std::istream> stream_;
  std::string path_;
  std::size_t line_number_ = 0;
  bool is_cut_ = false;  ///< The line of that number, which is the last.
  std::map<std::string, std::int64_t> last_times_ns_;  ///< By interface.
};

}  // namespace relocd
