#include "can/dbc.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
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
/// Bytes of the longest message of J1939.
constexpr int kMaxMessageSize = 1785;
constexpr std::uint64_t kMaxId = std::numeric_limits<std::uint32_t>::max();

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

  /// A raw value of up to 64 bits, signed or not, as its two's complement.
  std::uint64_t RawValue(const char* what) {
    const std::string_view word = TakeNumber();
    if (const auto value = ParseInt64(word)) return static_cast<std::uint64_t>(*value);
    std::uint64_t large = 0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), large);
    if (word.empty() || error != std::errc() || end != word.data() + word.size()) {
      Fail(what, word, "an integer of at most 64 bits");
    }
    return large;
  }

  /// A value of up to 64 bits without a sign, such as an end of `1-5`.
  std::uint64_t Digits(const char* what) {
    const std::string_view word =
        TakeWhile([](char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; });
    std::uint64_t value = 0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (word.empty() || error != std::errc()) {
      Fail(what, word, "an integer of at most 64 bits without a sign");
    }
    return value;
  }

  /// The text between double quotes, in which \" is a quote.
  std::string Quoted(const char* what) {
    SkipBlanks();
    std::string text;
    bool escaped = false;
    for (std::size_t i = 1; rest_.starts_with('"') && i < rest_.size(); ++i) {
      const char c = rest_[i];
      if (c == '"' && !escaped) {
        rest_.remove_prefix(i + 1);
        return text;
      }
      if (c == '"') text.pop_back();
      escaped = c == '\\' && !escaped;
      text += c;
    }
    Fail(what, rest_.substr(0, 1), "text in double quotes on one line");
    return {};
  }

  /// The next word, which may be anything.
  std::string_view Word() { return TakeWhile(IsNameCharacter); }

  [[nodiscard]] bool AtEnd() {
    SkipBlanks();
    return rest_.empty() || rest_.front() == ';';
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
  void SkipBlanks() {
    rest_.remove_prefix(std::min(rest_.find_first_not_of(" \t\n"), rest_.size()));
  }

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

/// An identifier as the file has it: extended ones with bit 31 set.
CanId IdOf(std::uint64_t number) {
  const auto id = static_cast<std::uint32_t>(number);
  return {.value = id & ~kCanExtendedFlag, .extended = (id & kCanExtendedFlag) != 0};
}

/// `BO_ 170 WHEEL_SPEEDS: 8 XXX`, behind the keyword.
Result<DbcMessage> ParseMessage(LineParser parser) {
  const auto id = static_cast<std::uint32_t>(parser.Integer("message identifier", kMaxId));
  DbcMessage message;
  message.name = parser.Name("message name");
  parser.Expect(':', "what follows the message name");
  message.size = static_cast<int>(parser.Integer("message size", kMaxMessageSize));
  if (auto ok = parser.status(); !ok) return std::move(ok).error();

  message.id = IdOf(id);
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
  const auto selected = static_cast<std::uint64_t>(*value);
  signal.mux_ranges = {{.first = selected, .last = selected}};
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
  signal.start_bit = static_cast<int>(parser.Integer("start bit", kMaxMessageSize * 8 - 1));
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

/// Puts the multiplexor's name into each signal that has one, unless SG_MUL_VAL_ did.
void NameMultiplexors(DbcMessage& message) {
  const auto is_root = [](const DbcSignal& signal) {
    return signal.is_multiplexor && signal.mux_ranges.empty();
  };
  const auto multiplexors = std::count_if(message.signals.begin(),
                                          message.signals.end(),
                                          [](const DbcSignal& s) { return s.is_multiplexor; });
  const auto root = std::find_if(message.signals.begin(), message.signals.end(), is_root);
  // With several of them the number behind the m does not say of which it is a value.
  if (multiplexors != 1 || root == message.signals.end()) return;
  for (DbcSignal& signal : message.signals) {
    if (!signal.mux_ranges.empty() && signal.multiplexor.empty()) signal.multiplexor = root->name;
  }
}

/// Follows the signal's multiplexors up to one that is always there.
Result<void> CheckMultiplexing(const DbcMessage& message, const DbcSignal& signal) {
  const DbcSignal* above = &signal;
  for (std::size_t steps = 0; above != nullptr && !above->multiplexor.empty(); ++steps) {
    if (steps > message.signals.size()) {
      return Malformed(fmt::format(
          "signal {}.{}: its multiplexors go round in a circle", message.name, signal.name));
    }
    above = message.FindSignal(above->multiplexor);
  }
  return {};
}

/// Reads a file line by line, and sections that end with a `;` whole.
class DbcParser {
 public:
  Result<void> ParseLine(std::string_view line);
  [[nodiscard]] std::size_t line_number() const { return line_number_; }
  Result<std::vector<DbcMessage>> Finish() &&;

 private:
  Result<void> AddMessage(std::string_view rest);
  Result<void> AddSignal(std::string_view rest);
  /// Takes a line of a section, and reads it when its `;` is there.
  Result<void> ContinueSection(std::string_view line);
  Result<void> ReadSection();
  Result<void> SetRawType(LineParser parser);
  Result<void> SetMultiplexing(LineParser parser);
  Result<void> SetValueNames(LineParser parser);
  Result<void> AddValueTable(LineParser parser);
  Result<void> SetComment(LineParser parser);
  Result<void> SetAttribute(LineParser parser);

  /// nullptr when there is none.
  DbcMessage* Find(CanId id);
  DbcSignal* Find(CanId id, std::string_view signal_name);

  std::size_t line_number_ = 0;  ///< Of the last line that was read; the first is 1.
  std::vector<DbcMessage> messages_;
  std::map<CanId, std::size_t> indices_;  ///< Into messages_.
  std::set<std::string> names_;
  std::map<std::string, std::map<std::int64_t, std::string>> value_tables_;
  bool in_new_symbols_ = false;   ///< Within NS_, which lists keywords, one a line.
  std::string keyword_;           ///< Of the section that is being read; empty outside of one.
  std::string section_;           ///< What it said so far.
  std::size_t section_line_ = 0;  ///< Where it began.
  bool in_quotes_ = false;        ///< Within a text of it.
  bool escaped_ = false;          ///< Behind a backslash within a text.
};

/// Sections that may go over lines, until a `;` outside of quotes.
bool EndsWithSemicolon(std::string_view keyword) {
  constexpr std::array<std::string_view, 21> kKeywords = {
      "BA_",         "BA_DEF_",       "BA_DEF_DEF_",      "BA_DEF_DEF_REL_",
      "BA_DEF_REL_", "BA_REL_",       "BA_DEF_SGTYPE_",   "BA_SGTYPE_",
      "BO_TX_BU_",   "CAT_",          "CAT_DEF_",         "CM_",
      "EV_",         "ENVVAR_DATA_",  "SGTYPE_",          "SIG_GROUP_",
      "SG_MUL_VAL_", "SIG_TYPE_REF_", "SIGTYPE_VALTYPE_", "VAL_",
      "VAL_TABLE_"};
  return std::find(kKeywords.begin(), kKeywords.end(), keyword) != kKeywords.end();
}

Result<void> DbcParser::ParseLine(std::string_view line) {
  ++line_number_;
  if (!keyword_.empty()) return ContinueSection(line);
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
  if (keyword == "SIG_VALTYPE_") return SetRawType(LineParser(rest));
  if (EndsWithSemicolon(keyword)) {
    keyword_ = keyword;
    section_line_ = line_number_;
    return ContinueSection(rest);
  }
  if (IsName(keyword)) return {};  // VERSION, NS_, BS_, BU_ and what later versions may bring
  return Malformed(fmt::format("'{}', must begin with a keyword such as BO_ or SG_",
                               line.substr(0, std::min<std::size_t>(line.size(), 20))));
}

Result<void> DbcParser::ContinueSection(std::string_view line) {
  if (line.ends_with('\r')) line.remove_suffix(1);
  for (const char c : line) {
    if (c == '"' && !escaped_) in_quotes_ = !in_quotes_;
    escaped_ = in_quotes_ && c == '\\' && !escaped_;  // some tools write \" within a text
    if (c != ';' || in_quotes_) {
      section_ += c;
      continue;
    }
    auto ok = ReadSection();  // what follows on the line is passed over
    keyword_.clear();
    section_.clear();
    return ok;
  }
  section_ += '\n';
  escaped_ = false;
  return {};
}

Result<void> DbcParser::ReadSection() {
  const LineParser parser(section_);
  if (keyword_ == "SG_MUL_VAL_") return SetMultiplexing(parser);
  if (keyword_ == "VAL_") return SetValueNames(parser);
  if (keyword_ == "VAL_TABLE_") return AddValueTable(parser);
  if (keyword_ == "CM_") return SetComment(parser);
  if (keyword_ == "BA_") return SetAttribute(parser);
  return {};
}

DbcMessage* DbcParser::Find(CanId id) {
  const auto found = indices_.find(id);
  return found == indices_.end() ? nullptr : &messages_[found->second];
}

DbcSignal* DbcParser::Find(CanId id, std::string_view signal_name) {
  DbcMessage* const message = Find(id);
  if (message == nullptr) return nullptr;
  const auto signal = std::find_if(message->signals.begin(),
                                   message->signals.end(),
                                   [&](const DbcSignal& s) { return s.name == signal_name; });
  return signal == message->signals.end() ? nullptr : &*signal;
}

Result<void> DbcParser::AddMessage(std::string_view rest) {
  auto message = ParseMessage(LineParser(rest));
  if (!message) return std::move(message).error();
  if (!indices_.emplace(message->id, messages_.size()).second) {
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
Result<void> DbcParser::SetRawType(LineParser parser) {
  const CanId id = IdOf(parser.Integer("message identifier", kMaxId));
  const std::string name = parser.Name("signal name");
  parser.Take(':');
  const auto type = parser.Integer("type of the raw value", 3);
  if (auto ok = parser.status(); !ok) return ok;
  DbcSignal* const signal = Find(id, name);
  if (signal == nullptr || type == 0 || type == 3) return {};
  const int length = type == 1 ? 32 : 64;
  if (signal->length != length) {
    return Malformed(fmt::format("floating-point signal {}.{} has {} bits, must have {}",
                                 Find(id)->name,
                                 name,
                                 signal->length,
                                 length));
  }
  signal->type = type == 1 ? RawType::kFloat : RawType::kDouble;
  return {};
}

/// ` 170 SIGNAL MULTIPLEXOR 1-1, 5-10`, behind the keyword.
Result<void> DbcParser::SetMultiplexing(LineParser parser) {
  const CanId id = IdOf(parser.Integer("message identifier", kMaxId));
  const std::string name = parser.Name("signal name");
  const std::string multiplexor = parser.Name("name of the multiplexor");
  std::vector<MuxRange> ranges;
  do {
    MuxRange range;
    range.first = parser.Digits("first value of a range");
    parser.Expect('-', "what follows the first value of a range");
    range.last = parser.Digits("last value of a range");
    if (auto ok = parser.status(); !ok) return ok;
    if (range.first > range.last) {
      return Malformed(fmt::format(
          "range of signal {} is {}-{}, must not go backwards", name, range.first, range.last));
    }
    ranges.push_back(range);
  } while (parser.Take(',') || !parser.AtEnd());
  DbcMessage* const message = Find(id);
  DbcSignal* const signal = Find(id, name);
  if (signal == nullptr) return {};
  const DbcSignal* const above = message->FindSignal(multiplexor);
  if (above == nullptr || !above->is_multiplexor) {
    return Malformed(fmt::format("multiplexor of signal {}.{} is {}, must be a signal with M there",
                                 message->name,
                                 name,
                                 multiplexor));
  }
  signal->multiplexor = multiplexor;
  signal->mux_ranges = std::move(ranges);
  return {};
}

/// `0 "standing" 1 "moving"`.
std::map<std::int64_t, std::string> ParseValueNames(LineParser& parser) {
  std::map<std::int64_t, std::string> names;
  while (!parser.AtEnd() && parser.status()) {
    const std::uint64_t value = parser.RawValue("value that is named");
    names[static_cast<std::int64_t>(value)] = parser.Quoted("name of a value");
  }
  return names;
}

/// ` 170 FR 0 "standing" 1 "moving" `, or ` 170 FR TABLE`, behind the keyword.
Result<void> DbcParser::SetValueNames(LineParser parser) {
  LineParser ahead = parser;
  if (IsName(ahead.Word())) return {};  // of an environment variable
  const CanId id = IdOf(parser.Integer("message identifier", kMaxId));
  const std::string name = parser.Name("signal name");
  if (auto ok = parser.status(); !ok) return ok;
  ahead = parser;
  const std::string table(ahead.Word());
  const auto known = value_tables_.find(table);
  auto names = known != value_tables_.end() ? known->second
               : IsName(table)              ? std::map<std::int64_t, std::string>()
                                            : ParseValueNames(parser);
  if (auto ok = parser.status(); !ok) return ok;
  if (DbcSignal* const signal = Find(id, name)) signal->value_names = std::move(names);
  return {};
}

/// ` TABLE 0 "standing" 1 "moving" `, behind the keyword.
Result<void> DbcParser::AddValueTable(LineParser parser) {
  const std::string name = parser.Name("name of the value table");
  auto names = ParseValueNames(parser);
  if (auto ok = parser.status(); !ok) return ok;
  value_tables_[name] = std::move(names);
  return {};
}

/// ` SG_ 170 FR "text"`, ` BO_ 170 "text"` or of what we have no place for, behind the keyword.
Result<void> DbcParser::SetComment(LineParser parser) {
  const std::string kind(parser.Word());
  if (kind != "SG_" && kind != "BO_") return {};
  const CanId id = IdOf(parser.Integer("message identifier", kMaxId));
  const std::string name = kind == "SG_" ? parser.Name("signal name") : "";
  std::string comment = parser.Quoted("comment");
  if (auto ok = parser.status(); !ok) return ok;
  DbcMessage* const message = Find(id);
  DbcSignal* const signal = Find(id, name);
  if (signal != nullptr) {
    signal->comment = std::move(comment);
  } else if (message != nullptr && name.empty()) {
    message->comment = std::move(comment);
  }
  return {};
}

/// ` "GenMsgCycleTime" BO_ 170 12`, in ms, behind the keyword.
Result<void> DbcParser::SetAttribute(LineParser parser) {
  const std::string name = parser.Quoted("name of the attribute");
  if (auto ok = parser.status(); !ok) return ok;
  if (name != "GenMsgCycleTime" || parser.Word() != "BO_") return {};
  const CanId id = IdOf(parser.Integer("message identifier", kMaxId));
  const double cycle_time_ms = parser.Number("cycle time");
  if (auto ok = parser.status(); !ok) return ok;
  DbcMessage* const message = Find(id);
  if (message != nullptr && cycle_time_ms > 0.0) message->cycle_time_s = 1e-3 * cycle_time_ms;
  return {};
}

Result<std::vector<DbcMessage>> DbcParser::Finish() && {
  if (!keyword_.empty()) {
    return Malformed(fmt::format(
        "line {}: {} begins here and has no end, must end with ';'", section_line_, keyword_));
  }
  if (messages_.empty()) return Malformed("has no message (BO_), must have at least one");
  for (DbcMessage& message : messages_) {
    NameMultiplexors(message);
    for (const DbcSignal& signal : message.signals) {
      if (auto ok = CheckMultiplexing(message, signal); !ok) return std::move(ok).error();
    }
  }
  return std::move(messages_);
}

}  // namespace

const DbcSignal* DbcMessage::FindSignal(std::string_view signal_name) const {
  const auto found = std::find_if(signals.begin(), signals.end(), [&](const DbcSignal& signal) {
    return signal.name == signal_name;
  });
  return found == signals.end() ? nullptr : &*found;
}

Result<DbcFile> DbcFile::Read(const std::string& path) {
  auto text = ReadFile(path);
  if (!text) return std::move(text).error();
  return Parse(*text, path);
}

Result<DbcFile> DbcFile::Parse(std::string_view text, const std::string& path) {
  constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
  if (text.starts_with(kByteOrderMark)) text.remove_prefix(kByteOrderMark.size());
  DbcParser parser;
  while (!text.empty()) {
    const auto end = text.find('\n');
    auto ok = parser.ParseLine(text.substr(0, end));
    if (!ok) {
      return std::move(ok).error().WithContext(
          fmt::format("{}: line {}", path, parser.line_number()));
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
  if (message->size > static_cast<int>(CanFrame::kMaxSize)) {
    return Malformed(
        fmt::format("{}: signal '{}' is in a message of {} bytes, must be in one of up "
                    "to {}, which a frame can hold",
                    path_,
                    full_name,
                    message->size,
                    CanFrame::kMaxSize));
  }
  for (const DbcSignal* above = signal; !above->mux_ranges.empty();
       above = message->FindSignal(above->multiplexor)) {
    if (!above->multiplexor.empty()) continue;
    return Malformed(fmt::format(
        "{}: signal '{}' depends on several multiplexors, or none: SG_MUL_VAL_ must say "
        "on which",
        path_,
        full_name));
  }
  return SignalReference{.message = &*message, .signal = signal};
}

const DbcMessage* DbcFile::FindMessage(CanId id) const {
  const auto found = std::find_if(
      messages_.begin(), messages_.end(), [&](const DbcMessage& m) { return m.id == id; });
  return found == messages_.end() ? nullptr : &*found;
}

Result<const DbcMessage*> DbcFile::FindMessage(std::string_view name) const {
  std::vector<std::string> names;
  for (const DbcMessage& message : messages_) {
    if (message.name == name) return &message;
    names.push_back(message.name);
  }
  return Malformed(fmt::format("{}: has no message '{}', nearest are {}",
                               path_,
                               name,
                               fmt::join(NearestNames(name, names, 3), ", ")));
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
