#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "can/can_frame.h"
#include "core/result.h"

namespace relocd {

/// In which order the bits of a signal lie in the frame.
enum class ByteOrder {
  kLittleEndian,  ///< `@1`, Intel: the start bit is the least significant one.
  kBigEndian,     ///< `@0`, Motorola: the start bit is the most significant one.
};

enum class RawType { kUnsigned, kSigned, kFloat, kDouble };

/// Values of a multiplexor, both ends included.
struct MuxRange {
  std::uint64_t first = 0;
  std::uint64_t last = 0;

  [[nodiscard]] bool Contains(std::uint64_t value) const { return first <= value && value <= last; }
};

/// A number within a frame. Bit n of a frame is bit n % 8 of byte n / 8.
struct DbcSignal {
  std::string name{};
  int start_bit = 0;
  int length = 1;  ///< Bits, 1 to 64.
  ByteOrder byte_order = ByteOrder::kLittleEndian;
  RawType type = RawType::kUnsigned;
  double factor = 1.0;  ///< physical = raw * factor + offset.
  double offset = 0.0;
  double minimum = 0.0;  ///< As the file says; equal to the maximum where it says nothing.
  double maximum = 0.0;
  std::string unit{};
  std::string comment{};
  /// Names of raw values, such as 3 "reverse"; values of 64 bits unsigned as their two's
  /// complement.
  std::map<std::int64_t, std::string> value_names{};
  bool is_multiplexor = false;  ///< Its raw value says which signals are in the frame.
  /// In the frame only if `multiplexor` has a value in one of these ranges; always if there are
  /// none.
  std::vector<MuxRange> mux_ranges{};
  /// A signal of the same message. Empty with ranges: the file does not say which, so that the
  /// signal is never found.
  std::string multiplexor{};

  [[nodiscard]] bool is_integer() const {
    return type == RawType::kUnsigned || type == RawType::kSigned;
  }
};

struct DbcMessage {
  CanId id{};
  std::string name{};
  /// Bytes. More than CanFrame::kMaxSize in files for J1939, whose long messages come in parts.
  int size = 0;
  std::string comment{};
  std::optional<double> cycle_time_s{};  ///< Between two frames, if the file says so.
  std::vector<DbcSignal> signals{};

  /// @return nullptr when there is none.
  [[nodiscard]] const DbcSignal* FindSignal(std::string_view signal_name) const;
};

/// The messages and signals of a CAN database in Vector's DBC format.
///
/// Understood are BO_, SG_ with simple and, by SG_MUL_VAL_, extended multiplexing, SIG_VALTYPE_,
/// VAL_, VAL_TABLE_, CM_ and the attribute GenMsgCycleTime; every other section is passed over.
/// What such a section says of messages and signals that are not there is passed over, too.
class DbcFile {
 public:
  /// @return kUnavailable when the file cannot be read; kInvalidInput with file, line and what is
  ///         allowed when it is not a DBC file, or a signal does not fit into its message.
  static Result<DbcFile> Read(const std::string& path);
  static Result<DbcFile> Parse(std::string_view text, const std::string& path);

  [[nodiscard]] const std::string& path() const { return path_; }
  [[nodiscard]] const std::vector<DbcMessage>& messages() const { return messages_; }

  /// @return nullptr when there is none.
  [[nodiscard]] const DbcMessage* FindMessage(CanId id) const;
  /// @return kInvalidInput, naming the file and the nearest names, when there is none.
  [[nodiscard]] Result<const DbcMessage*> FindMessage(std::string_view name) const;

  struct SignalReference {
    const DbcMessage* message = nullptr;  ///< Of this file, never nullptr.
    const DbcSignal* signal = nullptr;
  };
  /// The signal called `MESSAGE.SIGNAL`.
  ///
  /// @return kInvalidInput, naming the file and the nearest names, when there is none, or no frame
  ///         can be seen to hold it.
  [[nodiscard]] Result<SignalReference> FindSignal(std::string_view full_name) const;

 private:
  /// Full names, `MESSAGE.SIGNAL`.
  [[nodiscard]] std::vector<std::string> SignalNames() const;

  std::string path_;
  std::vector<DbcMessage> messages_;
};

}  // namespace relocd
