#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "can/can_bus_status.h"
#include "can/can_config.h"
#include "can/can_frame.h"
#include "core/result.h"

namespace relocd {

/// Where odometryd's frames come from: a bus, another process, or a recording. One that is lost can
/// be opened again.
///
/// Thread-bound.
class CanSource {
 public:
  CanSource() = default;
  virtual ~CanSource() = default;
  CanSource(const CanSource&) = delete;
  CanSource& operator=(const CanSource&) = delete;
  CanSource(CanSource&&) = delete;
  CanSource& operator=(CanSource&&) = delete;

  /// Opens the source, for the first time or again.
  ///
  /// @return kUnavailable when it is not there now; kInvalidInput when trying again is no use.
  virtual Result<void> Open() = 0;

  /// To be watched for readability by an event loop; -1 while closed. Another one after Open.
  [[nodiscard]] virtual int fd() const = 0;

  /// The oldest waiting data frame, or nothing when none waits. Does not block.
  ///
  /// @return an error when the source is lost, which is then closed.
  virtual Result<std::optional<CanFrame>> Receive() = 0;

  /// Since the source was made.
  [[nodiscard]] virtual CanBusStatus status() const = 0;

  /// For messages: `can0`, `candump log x.log`.
  [[nodiscard]] virtual std::string description() const = 0;

  [[nodiscard]] bool is_open() const { return fd() >= 0; }
};

/// The source that the config asks for, not yet opened.
///
/// @param ids  the frames that are wanted; empty for all.
/// @param epoch  candump: the time of `playback_start_s` (core/playback_epoch.h).
std::unique_ptr<CanSource> MakeCanSource(const CanConfig& config,
                                         std::vector<CanId> ids,
                                         MonotonicTime epoch);

}  // namespace relocd
