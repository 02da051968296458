#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "can/can_source.h"
#include "can/candump_log.h"
#include "core/unique_fd.h"

namespace relocd {

/// Plays a candump log on the wall clock: a frame recorded t after `playback_start_s` comes, and is
/// stamped, at `epoch` + t. Opened in the middle, it resumes in the middle. After the last frame it
/// stays open and gives nothing.
class CandumpSource final : public CanSource {
 public:
  CandumpSource(const CanConfig& config, std::vector<CanId> ids, MonotonicTime epoch);

  /// Reads the whole log once to check it.
  ///
  /// @return kInvalidInput when it is not there, or a line is none, or none is due within an hour.
  Result<void> Open() override;
  [[nodiscard]] int fd() const override { return timer_.get(); }
  Result<std::optional<CanFrame>> Receive() override;
  [[nodiscard]] CanBusStatus status() const override { return status_; }
  [[nodiscard]] std::string description() const override { return "candump log " + path_; }

  /// Whether the last frame was given.
  [[nodiscard]] bool ended() const { return is_open() && !next_; }

 private:
  Result<void> ReadNext();
  Result<void> ArmTimer(MonotonicTime due);
  [[nodiscard]] bool IsWanted(const CanId& id) const;

  std::string path_;
  std::string interface_;
  std::vector<CanId> ids_;
  std::int64_t start_ns_;
  MonotonicTime epoch_;
  UniqueFd timer_;
  std::optional<CandumpLog> log_;
  std::optional<CanFrame> next_;  ///< Its receive_time is when it is due.
  CanBusStatus status_;
};

}  // namespace relocd
