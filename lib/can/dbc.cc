#include "can/dbc.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstddef>
#include <limits>
#include <map>
#include <set>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "can/signal.h"
#include "core/file.h"
#include "core/nearest_name.h"
#include "core/parse_number.h"

namespace relocd {
namespace {

/// Holds signals that belong to no message, and is no frame on the bus.
constexpr std::string_view kOrphanMessage = "VECTOR__INDEPENDENT_SIG_MSG";

Error Malformed(std::string message) {
  return {ErrorKind::kInvalidInput, std::move(message)};
}

bool IsNameCharacter(char c) {
  return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_';
}

bool IsName(std::string_view text) {
  return !text.empty() && std::isdigit(static_cast<unsigned char>(text.front())) == 0 &&
         std::all_of(text.begin(), text.end(), IsNameCharacter);
}

/// Reads the parts of one line from left to right. After a part that is missing or wrong, error()
/// says so, and the parts after it are empty.
class LineParser {
 public:
  explicit LineParser(std::string_view line) : rest_(line) {}

  /// A C identifier.
  std::string Name(const char* what) {
    const std::string_view word = TakeWhile(IsNameCharacter);
    if (!IsName(word)) Fail(what, word, "a name of letters, digits and _");
    return std::string(word);
  }

  double Number(const char* what) {
    const std::string_view word = TakeNumber();
    const auto value = ParseDouble(word);
    if (!value || !std::isfinite(*value)) Fail(what, word, "a finite number");
    return value.value_or(0.0);
  }

  std::uint64_t Integer(const char* what, std::uint64_t maximum) {
    const std::string_view word = TakeNumber();
    const auto value = ParseInt64(word);
    if (!value || *value < 0 || static_cast<std::uint64_t>(*value) > maximum) {
      Fail(what, word, fmt::format("an integer from 0 to {}", maximum));
      return 0;
    }
    return static_cast<std::uint64_t>(*value);
  }

  /// The text between double quotes.
  std::string Quoted(const char* what) {
    SkipBlanks();
    const auto end = rest_.starts_with('"') ? rest_.find('"', 1) : std::string_view::npos;
    if (end == std::string_view::npos) {
      Fail(what, rest_.substr(0, 1), "text in double quotes on one line");
      return {};
    }
    std::string text(rest_.substr(1, end - 1));
    rest_.remove_prefix(end + 1);
    return text;
  }

  /// Takes `c` if it is next.
  bool Take(char c) {
    SkipBlanks();
    if (!rest_.starts_with(c)) return false;
    rest_.remove_prefix(1);
    return true;
  }

  void Expect(char c, const char* what) {
    if (!Take(c)) Fail(what, rest_.substr(0, 1), fmt::format("'{}'", c));
  }

  [[nodiscard]] Result<void> status() const {
    if (error_.empty()) return {};
    return Malformed(error_);
  }

 private:
  void SkipBlanks() { rest_.remove_prefix(std::min(rest_.find_first_not_of(" \t"), rest_.size())); }

  template <typename Predicate>
  std::string_view TakeWhile(Predicate belongs) {
    SkipBlanks();
    const auto end = std::find_if_not(rest_.begin(), rest_.end(), belongs);
    const std::string_view word = rest_.substr(0, static_cast<std::size_t>(end - rest_.begin()));
    rest_.remove_prefix(word.size());
    return word;
  }

  std::string_view TakeNumber() {
    return TakeWhile([](char c) { return IsNameCharacter(c) || c == '+' || c == '-' || c == '.'; });
  }

  void Fail(const char* what, std::string_view found, std::string_view allowed) {
    if (!error_.empty()) return;
    error_ = fmt::format("{} is '{}', must be {}", what, found, allowed);
    rest_ = {};
  }

  std::string_view rest_;
  std::string error_;
};

/// `BO_ 170 WHEEL_SPEEDS: 8 XXX`, behind the keyword.
Result<DbcMessage> ParseMessage(LineParser parser) {
  constexpr std::uint32_t kExtendedBit = kCanExtendedFlag;
  const auto id = static_cast<std::uint32_t>(
      parser.Integer("message identifier", std::numeric_limits<std::uint32_t>::max()));
  DbcMessage message;
  message.name = parser.Name("message name");
  parser.Expect(':', "what follows the message name");
  message.size = static_cast<int>(parser.Integer("message size", CanFrame::kMaxSize));
  if (auto ok = parser.status(); !ok) return std::move(ok).error();

  message.id.extended = (id & kExtendedBit) != 0;
  message.id.value = id & ~kExtendedBit;
  const std::uint32_t maximum = message.id.extended ? kCanExtendedMask : kCanStandardMask;
  if (message.id.value > maximum && message.name != kOrphanMessage) {
    return Malformed(fmt::format(
        "message identifier of {} is {}, must be up to 2047, or 2147483648 and up to 29 bits",
        message.name,
        id));
  }
  return message;
}

/// Nothing, `M`, `m3`, or `m3M`, which is a multiplexor that is itself multiplexed.
Result<void> ParseMultiplexing(std::string_view text, DbcSignal& signal) {
  std::string_view rest = text;
  if (rest.ends_with('M')) {
    signal.is_multiplexor = true;
    rest.remove_suffix(1);
  }
  if (rest.empty()) return {};
  const auto value = rest.starts_with('m') ? ParseInt64(rest.substr(1)) : std::nullopt;
  if (!value || *value < 0) {
    return Malformed(fmt::format(
        "multiplexing of signal {} is '{}', must be M or m and a number", signal.name, text));
  }
  signal.mux_value = static_cast<std::uint64_t>(*value);
  return {};
}

/// ` RL : 54|15@0+ (0.01,-67.67) [0|250] "km/h" XXX`, behind the keyword.
Result<DbcSignal> ParseSignal(LineParser parser) {
  DbcSignal signal;
  signal.name = parser.Name("signal name");
  if (!parser.Take(':')) {
    const std::string multiplexing = parser.Name("multiplexing of the signal");
    parser.Expect(':', "what follows the signal name");
    if (auto ok = parser.status(); !ok) return std::move(ok).error();
    if (auto ok = ParseMultiplexing(multiplexing, signal); !ok) return std::move(ok).error();
  }
  signal.start_bit = static_cast<int>(parser.Integer("start bit", CanFrame::kMaxSize * 8 - 1));
  parser.Expect('|', "what follows the start bit");
  signal.length = static_cast<int>(parser.Integer("length in bits", 64));
  parser.Expect('@', "what follows the length");
  // `0+` and the like: one digit, then the sign, without which a number would swallow both.
  const bool little_endian = parser.Take('1');
  if (!little_endian) parser.Expect('0', "byte order (1 little endian, 0 big endian)");
  signal.byte_order = little_endian ? ByteOrder::kLittleEndian : ByteOrder::kBigEndian;
  const bool is_signed = parser.Take('-');
  if (!is_signed) parser.Expect('+', "sign (+ unsigned, - signed)");
  signal.type = is_signed ? RawType::kSigned : RawType::kUnsigned;
  parser.Expect('(', "what begins the factor");
  signal.factor = parser.Number("factor");
  parser.Expect(',', "what follows the factor");
  signal.offset = parser.Number("offset");
  parser.Expect(')', "what follows the offset");
  parser.Expect('[', "what begins the minimum");
  signal.minimum = parser.Number("minimum");
  parser.Expect('|', "what follows the minimum");
  signal.maximum = parser.Number("maximum");
  parser.Expect(']', "what follows the maximum");
  signal.unit = parser.Quoted("unit");
  if (auto ok = parser.status(); !ok) return std::move(ok).error();
  if (signal.factor == 0.0) {
    return Malformed(fmt::format("factor of signal {} is 0, must not be", signal.name));
  }
  return signal;
}

Result<void> CheckFits(const DbcSignal& signal, const DbcMessage& message) {
  if (message.FindSignal(signal.name) != nullptr) {
    return Malformed(fmt::format("signal {}.{} is there twice", message.name, signal.name));
  }
  if (signal.length < 1 || !SignalFits(signal, static_cast<std::size_t>(message.size))) {
    return Malformed(fmt::format("signal {}.{}: {} bits from bit {}, must lie within the {} bytes",
                                 message.name,
                                 signal.name,
                                 signal.length,
                                 signal.start_bit,
                                 message.size));
  }
  return {};
}

/// Reads a file line by line.
class DbcParser {
 public:
  Result<void> ParseLine(std::string_view line);
  Result<std::vector<DbcMessage>> Finish() &&;

 private:
  Result<void> AddMessage(std::string_view rest);
  Result<void> AddSignal(std::string_view rest);
  Result<void> SetRawType(std::string_view rest);
  /// Passes over text until the `;` that ends a section.
  void SkipUntilSemicolon(std::string_view text);

  std::vector<DbcMessage> messages_;
  std::set<CanId> ids_;
  std::set<std::string> names_;
  bool in_new_symbols_ = false;  ///< Within NS_, which lists keywords, one a line.
  bool skipping_ = false;        ///< Within a section that ends with `;`.
  bool in_quotes_ = false;       ///< Within a text of such a section.
};

/// Sections that may go over lines, until a `;` outside of quotes.
bool EndsWithSemicolon(std::string_view keyword) {
  constexpr std::array<std::string_view, 20> kKeywords = {"BA_",
                                                          "BA_DEF_",
                                                          "BA_DEF_DEF_",
                                                          "BA_DEF_DEF_REL_",
                                                          "BA_DEF_REL_",
                                                          "BA_REL_",
                                                          "BA_DEF_SGTYPE_",
                                                          "BA_SGTYPE_",
                                                          "BO_TX_BU_",
                                                          "CAT_",
                                                          "CAT_DEF_",
                                                          "CM_",
                                                          "EV_",
                                                          "ENVVAR_DATA_",
                                                          "SGTYPE_",
                                                          "SIG_GROUP_",
                                                          "SIG_MUL_VAL_",
                                                          "SIGTYPE_VALTYPE_",
                                                          "VAL_",
                                                          "VAL_TABLE_"};
  return std::find(kKeywords.begin(), kKeywords.end(), keyword) != kKeywords.end();
}

Result<void> DbcParser::ParseLine(std::string_view line) {
  if (skipping_) {
    SkipUntilSemicolon(line);
    return {};
  }
  line = Trim(line);
  if (line.empty() || line.starts_with("//")) return {};
  const std::string_view keyword =
      line.substr(0,
                  static_cast<std::size_t>(
                      std::find_if_not(line.begin(), line.end(), IsNameCharacter) - line.begin()));
  const std::string_view rest = line.substr(keyword.size());
  if (in_new_symbols_ && rest.empty()) return {};
  in_new_symbols_ = keyword == "NS_";
  if (keyword == "BO_") return AddMessage(rest);
  if (keyword == "SG_") return AddSignal(rest);
  if (keyword == "SIG_VALTYPE_") return SetRawType(rest);
  if (EndsWithSemicolon(keyword)) {
    skipping_ = true;
    SkipUntilSemicolon(rest);
    return {};
  }
  if (IsName(keyword)) return {};  // VERSION, NS_, BS_, BU_ and what later versions may bring
  return Malformed(fmt::format("'{}', must begin with a keyword such as BO_ or SG_",
                               line.substr(0, std::min<std::size_t>(line.size(), 20))));
}

void DbcParser::SkipUntilSemicolon(std::string_view text) {
  bool escaped = false;  // some tools write \" within a text
  for (const char c : text) {
    if (c == '"' && !escaped) in_quotes_ = !in_quotes_;
    escaped = in_quotes_ && c == '\\' && !escaped;
    if (c != ';' || in_quotes_) continue;
    skipping_ = false;  // what follows on the line is passed over, too
    return;
  }
}

Result<void> DbcParser::AddMessage(std::string_view rest) {
  auto message = ParseMessage(LineParser(rest));
  if (!message) return std::move(message).error();
  if (!ids_.insert(message->id).second) {
    return Malformed(fmt::format("message {}: another has the identifier {}, must be unique",
                                 message->name,
                                 message->id.value));
  }
  if (!names_.insert(message->name).second) {
    return Malformed(fmt::format("message {} is there twice", message->name));
  }
  messages_.push_back(std::move(message).value());
  return {};
}

Result<void> DbcParser::AddSignal(std::string_view rest) {
  if (messages_.empty()) return Malformed("signal (SG_) before any message (BO_)");
  DbcMessage& message = messages_.back();
  if (message.name == kOrphanMessage) return {};
  auto signal = ParseSignal(LineParser(rest));
  if (!signal) return std::move(signal).error();
  if (auto ok = CheckFits(*signal, message); !ok) return ok;
  message.signals.push_back(std::move(signal).value());
  return {};
}

/// ` 170 RL : 1;`, behind the keyword: the raw value is a float (1) or a double (2).
Result<void> DbcParser::SetRawType(std::string_view rest) {
  LineParser parser(rest);
  const auto id = static_cast<std::uint32_t>(
      parser.Integer("message identifier", std::numeric_limits<std::uint32_t>::max()));
  const std::string name = parser.Name("signal name");
  parser.Take(':');
  const auto type = parser.Integer("type of the raw value", 2);
  if (auto ok = parser.status(); !ok) return ok;
  const CanId can_id{.value = id & ~kCanExtendedFlag, .extended = (id & kCanExtendedFlag) != 0};
  const auto message = std::find_if(
      messages_.begin(), messages_.end(), [&](const DbcMessage& m) { return m.id == can_id; });
  if (message == messages_.end() || type == 0) return {};
  const auto signal = std::find_if(message->signals.begin(),
                                   message->signals.end(),
                                   [&](const DbcSignal& s) { return s.name == name; });
  if (signal == message->signals.end()) return {};
  const int length = type == 1 ? 32 : 64;
  if (signal->length != length) {
    return Malformed(fmt::format("floating-point signal {}.{} has {} bits, must have {}",
                                 message->name,
                                 name,
                                 signal->length,
                                 length));
  }
  signal->type = type == 1 ? RawType::kFloat : RawType::kDouble;
  return {};
}

Result<std::vector<DbcMessage>> DbcParser::Finish() && {
  if (skipping_) return Malformed("the file ends within a section, must end it with ';'");
  if (messages_.empty()) return Malformed("has no message (BO_), must have at least one");
  return std::move(messages_);
}

}  // namespace

const DbcSignal* DbcMessage::FindSignal(std::string_view signal_name) const {
  const auto found = std::find_if(signals.begin(), signals.end(), [&](const DbcSignal& signal) {
    return signal.name == signal_name;
  });
  return found == signals.end() ? nullptr : &*found;
}

const DbcSignal* DbcMessage::multiplexor() const {
  const auto found = std::find_if(signals.begin(), signals.end(), [](const DbcSignal& signal) {
    return signal.is_multiplexor;
  });
  return found == signals.end() ? nullptr : &*found;
}

Result<DbcFile> DbcFile::Read(const std::string& path) {
  auto text = ReadFile(path);
  if (!text) return std::move(text).error();
  return Parse(*text, path);
}

Result<DbcFile> DbcFile::Parse(std::string_view text, const std::string& path) {
  DbcParser parser;
  for (std::size_t line_number = 1; !text.empty(); ++line_number) {
    const auto end = text.find('\n');
    auto ok = parser.ParseLine(text.substr(0, end));
    if (!ok) {
      return std::move(ok).error().WithContext(fmt::format("{}: line {}", path, line_number));
    }
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
  }
  auto messages = std::move(parser).Finish();
  if (!messages) return std::move(messages).error().WithContext(path);
  DbcFile file;
  file.path_ = path;
  file.messages_ = std::move(messages).value();
  return file;
}

Result<DbcFile::SignalReference> DbcFile::FindSignal(std::string_view full_name) const {
  const auto dot = full_name.find('.');
  const auto message = std::find_if(messages_.begin(), messages_.end(), [&](const DbcMessage& m) {
    return m.name == full_name.substr(0, dot);
  });
  const DbcSignal* signal = message == messages_.end() || dot == std::string_view::npos
                                ? nullptr
                                : message->FindSignal(full_name.substr(dot + 1));
  if (signal == nullptr) {
    return Malformed(fmt::format("{}: has no signal '{}', nearest are {}",
                                 path_,
                                 full_name,
                                 fmt::join(NearestNames(full_name, SignalNames(), 3), ", ")));
  }
  const DbcSignal* multiplexor = message->multiplexor();
  if (signal->mux_value && multiplexor != nullptr && multiplexor->mux_value) {
    return Malformed(fmt::format(
        "{}: signal '{}' is multiplexed twice, must be at most once", path_, full_name));
  }
  return SignalReference{.message = &*message, .signal = signal};
}

std::vector<std::string> DbcFile::SignalNames() const {
  std::vector<std::string> names;
  for (const DbcMessage& message : messages_) {
    for (const DbcSignal& signal : message.signals)
      names.push_back(fmt::format("{}.{}", message.name, signal.name));
  }
  return names;
}

}  // namespace relocd
