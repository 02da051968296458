#include "can/candump_log.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <fstream>
#include <limits>
#include <sstream>
#include <utility>

#include <fmt/format.h>

#include "core/file.h"
#include "core/parse_number.h"

namespace relocd {
namespace {

constexpr std::int64_t kNanosecondsPerSecond = 1'000'000'000;

/// CAN FD frames have only these sizes.
constexpr std::array<std::uint8_t, 16> kFdSizes = {
    0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64};

Error Malformed(std::string message) {
  return {ErrorKind::kInvalidInput, std::move(message)};
}

/// The first word of `text`, which loses it.
std::string_view TakeWord(std::string_view& text) {
  text = Trim(text);
  const std::string_view word = text.substr(0, text.find_first_of(" \t"));
  text.remove_prefix(word.size());
  return word;
}

std::optional<std::uint32_t> ParseHex(std::string_view text) {
  std::uint32_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, 16);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

/// Whether `text` is digits only. from_chars would take a sign, too.
bool IsDigits(std::string_view text) {
  return !text.empty() && text.find_first_not_of("0123456789") == std::string_view::npos;
}

/// `(12.345678)` in ns, without going through a double that would lose digits.
std::optional<std::int64_t> ParseTime(std::string_view word) {
  if (word.size() < 2 || word.front() != '(' || word.back() != ')') return std::nullopt;
  word = word.substr(1, word.size() - 2);
  const auto dot = word.find('.');
  const std::string_view whole = word.substr(0, dot);
  std::string fraction(dot == std::string_view::npos ? "0" : word.substr(dot + 1));
  if (!IsDigits(whole) || !IsDigits(fraction) || fraction.size() > 9) return std::nullopt;
  fraction.resize(9, '0');
  const auto seconds = ParseInt64(whole);
  constexpr std::int64_t kMaxSeconds =
      std::numeric_limits<std::int64_t>::max() / kNanosecondsPerSecond - 1;
  if (!seconds || *seconds > kMaxSeconds) return std::nullopt;
  return *seconds * kNanosecondsPerSecond + *ParseInt64(fraction);
}

Result<void> ParseId(std::string_view text, CanFrame& frame) {
  const auto value = ParseHex(text);
  const bool standard = text.size() == 3 && value && *value <= kCanStandardMask;
  const bool extended = text.size() == 8 && value && (*value & ~kCanExtendedMask) == 0;
  const bool error = text.size() == 8 && value && (*value & ~kCanExtendedMask) == kCanErrorFlag;
  if (!standard && !extended && !error) {
    return Malformed(fmt::format(
        "identifier '{}', must be 3 hexadecimal digits up to 7FF or 8 up to 1FFFFFFF", text));
  }
  SetKernelCanId(frame, *value | (extended ? kCanExtendedFlag : 0));
  return {};
}

/// `1D0B7A` or `1D.0B.7A`.
Result<void> ParseData(std::string_view text, CanFrame& frame) {
  const std::size_t max_size = frame.fd ? CanFrame::kMaxSize : CanFrame::kMaxClassicalSize;
  const std::string_view whole = text;
  while (!text.empty()) {
    const auto byte = ParseHex(text.substr(0, 2));
    if (text.size() < 2 || !byte) {
      return Malformed(fmt::format("data '{}', must be pairs of hexadecimal digits", whole));
    }
    if (frame.size == max_size) {
      return Malformed(fmt::format("data '{}', must be at most {} bytes", whole, max_size));
    }
    frame.data.at(frame.size++) = static_cast<std::uint8_t>(*byte);
    text.remove_prefix(2);
    if (text.size() > 1 && text.front() == '.') text.remove_prefix(1);
  }
  return {};
}

/// What follows `##`: a digit of flags (1 bit rate switch, 2 error state), and the data.
Result<void> ParseFdData(std::string_view text, CanFrame& frame) {
  const auto flags = ParseHex(text.substr(0, 1));
  if (!flags) return Malformed("no digit of CAN FD flags after '##'");
  frame.fd = true;
  frame.bit_rate_switch = (*flags & 1U) != 0;
  frame.error_state_indicator = (*flags & 2U) != 0;
  if (auto ok = ParseData(text.substr(1), frame); !ok) return ok;
  if (std::find(kFdSizes.begin(), kFdSizes.end(), frame.size) == kFdSizes.end()) {
    return Malformed(fmt::format(
        "{} bytes of CAN FD data, must be 0 to 8, 12, 16, 20, 24, 32, 48 or 64", frame.size));
  }
  return {};
}

/// What follows `#R`: nothing, or the length asked for.
Result<void> ParseRemote(std::string_view text, CanFrame& frame) {
  frame.remote = true;
  if (text.empty() || (text.size() == 1 && text.front() >= '0' && text.front() <= '8')) return {};
  return Malformed(fmt::format("remote frame length '{}', must be 0 to 8 or nothing", text));
}

Result<CanFrame> ParseFrame(std::string_view word) {
  const auto hash = word.find('#');
  if (hash == std::string_view::npos) {
    return Malformed(fmt::format("frame '{}', must be ID#DATA", word));
  }
  CanFrame frame;
  if (auto ok = ParseId(word.substr(0, hash), frame); !ok) return std::move(ok).error();
  const std::string_view rest = word.substr(hash + 1);
  Result<void> parsed;
  if (rest.starts_with('#')) {
    parsed = ParseFdData(rest.substr(1), frame);
  } else if (rest.starts_with('R')) {
    parsed = ParseRemote(rest.substr(1), frame);
  } else {
    parsed = ParseData(rest, frame);
  }
  if (!parsed) return std::move(parsed).error();
  return frame;
}

}  // namespace

Result<CandumpRecord> ParseCandumpLine(std::string_view line) {
  std::string_view rest = line;
  const std::string_view time_word = TakeWord(rest);
  const auto time_ns = ParseTime(time_word);
  if (!time_ns) {
    return Malformed(fmt::format("time '{}', must be (SECONDS.MICROSECONDS)", time_word));
  }
  const std::string_view interface = TakeWord(rest);
  if (interface.empty()) return Malformed("no interface after the time, must be like can0");
  auto frame = ParseFrame(TakeWord(rest));
  if (!frame) return std::move(frame).error();
  const std::string_view direction = TakeWord(rest);
  if (!Trim(rest).empty() || (!direction.empty() && direction != "R" && direction != "T")) {
    return Malformed(
        fmt::format("'{}{}' after the frame, must be nothing, R or T", direction, rest));
  }
  CandumpRecord record{
      .time_ns = *time_ns, .interface = std::string(interface), .frame = std::move(frame).value()};
  record.frame.receive_time = FromNanoseconds(record.time_ns);
  return record;
}

std::string FormatCandumpLine(const CandumpRecord& record) {
  const CanFrame& frame = record.frame;
  std::string line = fmt::format("({}.{:06}) {} ",
                                 record.time_ns / kNanosecondsPerSecond,
                                 record.time_ns % kNanosecondsPerSecond / 1000,
                                 record.interface);
  const bool wide = frame.id.extended || frame.error;
  const std::uint32_t id = frame.id.value | (frame.error ? kCanErrorFlag : 0);
  line += wide ? fmt::format("{:08X}#", id) : fmt::format("{:03X}#", id);
  if (frame.remote) return line + "R";
  if (frame.fd) {
    const int flags = (frame.bit_rate_switch ? 1 : 0) + (frame.error_state_indicator ? 2 : 0);
    line += fmt::format("#{}", flags);
  }
  for (const std::uint8_t byte : frame.payload())
    line += fmt::format("{:02X}", byte);
  return line;
}

CandumpLog::CandumpLog(std::unique_ptr<std::istream> stream, std::string path)
    : stream_(std::move(stream)), path_(std::move(path)) {}

Result<CandumpLog> CandumpLog::Open(const std::string& path) {
  auto stream = std::make_unique<std::ifstream>(path, std::ios::binary);
  if (!stream->is_open()) {
    return SystemError(ErrorKind::kUnavailable, fmt::format("opening {}", path));
  }
  return CandumpLog(std::move(stream), path);
}

CandumpLog CandumpLog::FromText(std::string text, std::string path) {
  return {std::make_unique<std::istringstream>(std::move(text)), std::move(path)};
}

Result<std::optional<CandumpRecord>> CandumpLog::Next() {
  std::string line;
  while (std::getline(*stream_, line)) {
    ++line_number_;
    const std::string_view text = Trim(line);
    if (text.empty() || text.starts_with('#')) continue;
    auto record = ParseCandumpLine(text);
    // Without a line's end the stream is at its own.
    is_cut_ = !record && stream_->eof() && !last_times_ns_.empty();
    if (is_cut_) break;
    if (record) {
      if (auto ok = CheckOrder(*record); !ok) record = std::move(ok).error();
    }
    if (!record) {
      return std::move(record).error().WithContext(fmt::format("{}: line {}", path_, line_number_));
    }
    return std::optional(std::move(record).value());
  }
  if (stream_->bad()) return SystemError(ErrorKind::kUnavailable, fmt::format("reading {}", path_));
  return std::optional<CandumpRecord>();
}

std::string CandumpLog::LeftOut() const {
  return is_cut_ ? fmt::format("{}: line {} is cut off and left out", path_, line_number_) : "";
}

Result<std::optional<CanFrame>> CandumpLog::NextDataFrame(std::string_view interface) {
  while (true) {
    auto record = Next();
    if (!record) return std::move(record).error();
    if (!record->has_value()) return std::optional<CanFrame>();
    const CanFrame& frame = (*record)->frame;
    if ((*record)->interface == interface && !frame.error && !frame.remote)
      return std::optional(frame);
  }
}

Result<void> CandumpLog::CheckOrder(const CandumpRecord& record) {
  const auto [last, is_first] = last_times_ns_.try_emplace(record.interface, record.time_ns);
  if (record.time_ns < last->second) {
    return Malformed(fmt::format(
        "time {:.6f} s is before the {:.6f} s of the frame before on {}, must not decrease",
        static_cast<double>(record.time_ns) * 1e-9,
        static_cast<double>(last->second) * 1e-9,
        record.interface));
  }
  last->second = record.time_ns;
  return {};
}

}  // namespace relocd
