#pragma once

#include <cstdint>
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
  bool is_multiplexor = false;  ///< Its raw value says which signals are in the frame.
  std::optional<std::uint64_t>
      mux_value{};  ///< In the frame only if the multiplexor has this value.
};

struct DbcMessage {
  CanId id{};
  std::string name{};
  int size = 0;  ///< Bytes.
  std::vector<DbcSignal> signals{};

  /// @return nullptr when there is none.
  [[nodiscard]] const DbcSignal* FindSignal(std::string_view signal_name) const;
  [[nodiscard]] const DbcSignal* multiplexor() const;
};

/// The messages and signals of a CAN database in Vector's DBC format.
///
/// Understood are BO_, SG_ (with simple multiplexing) and SIG_VALTYPE_; every other section is
/// passed over.
class DbcFile {
 public:
  /// @return kUnavailable when the file cannot be read; kInvalidInput with file, line and what is
  ///         allowed when it is not a DBC file, or a signal does not fit into its message.
  static Result<DbcFile> Read(const std::string& path);
  static Result<DbcFile> Parse(std::string_view text, const std::string& path);

  [[nodiscard]] const std::string& path() const { return path_; }
  [[nodiscard]] const std::vector<DbcMessage>& messages() const { return messages_; }

  struct SignalReference {
    const DbcMessage* message = nullptr;  ///< Of this file, never nullptr.
    const DbcSignal* signal = nullptr;
  };
  /// The signal called `MESSAGE.SIGNAL`.
  ///
  /// @return kInvalidInput, naming the file and the nearest names, when there is none.
  [[nodiscard]] Result<SignalReference> FindSignal(std::string_view full_name) const;

 private:
  /// Full names, `MESSAGE.SIGNAL`.
  [[nodiscard]] std::vector<std::string> SignalNames() const;

  std::string path_;
  std::vector<DbcMessage> messages_;
};

}  // namespace relocd
