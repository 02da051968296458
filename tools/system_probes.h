#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "camera/camera_config.h"
#include "core/result.h"

namespace relocd {

/// What `reloc doctor` asks of the machine, so that a test can be the machine.
class SystemProbes {
 public:
  /// The camera that a map was made for.
  struct MapCamera {
    int width = 0;   ///< px
    int height = 0;  ///< px
  };

  SystemProbes() = default;
  virtual ~SystemProbes() = default;
  SystemProbes(const SystemProbes&) = delete;
  SystemProbes& operator=(const SystemProbes&) = delete;
  SystemProbes(SystemProbes&&) = delete;
  SystemProbes& operator=(SystemProbes&&) = delete;

  /// The file's text; nothing when it cannot be read.
  [[nodiscard]] virtual std::optional<std::string> Read(const std::string& path) = 0;
  [[nodiscard]] virtual bool Exists(const std::string& path) = 0;
  /// What the program writes to stdout; nothing when it cannot be run or fails.
  [[nodiscard]] virtual std::optional<std::string> Output(
      const std::vector<std::string>& command) = 0;
  /// Free for other users than root, on the disk of the folder or of the nearest one above it.
  [[nodiscard]] virtual std::optional<std::int64_t> FreeBytes(const std::string& folder) = 0;
  /// Sends a message on the LCM network, and waits for it to come back.
  [[nodiscard]] virtual Result<void> LoopBack(const std::string& lcm_url) = 0;
  /// Whether the kernel's wall clock is kept by a time server.
  [[nodiscard]] virtual bool IsClockSynchronized() = 0;
  [[nodiscard]] virtual Result<MapCamera> ReadMapCamera(const std::string& path) = 0;
  /// What a V4L2 camera offers.
  [[nodiscard]] virtual Result<std::string> DescribeCamera(const CameraConfig& config) = 0;
};

/// This machine.
class ThisMachine final : public SystemProbes {
 public:
  std::optional<std::string> Read(const std::string& path) override;
  bool Exists(const std::string& path) override;
  std::optional<std::string> Output(const std::vector<std::string>& command) override;
  std::optional<std::int64_t> FreeBytes(const std::string& folder) override;
  Result<void> LoopBack(const std::string& lcm_url) override;
  bool IsClockSynchronized() override;
  Result<MapCamera> ReadMapCamera(const std::string& path) override;
  Result<std::string> DescribeCamera(const CameraConfig& config) override;
};

}  // namespace relocd
