#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "config/config.h"

namespace relocd {

/// A config's top-level sections as text, by name, and its cameras' apart from each other.
///
/// Serves to tell which daemons a changed config concerns, without a list of keys to keep up.
class ConfigSections {
 public:
  explicit ConfigSections(const Config& config);

  [[nodiscard]] std::vector<std::string> CameraNames() const;

  /// The text of all sections that a process reads: another text means that it must start again.
  /// Sections that nobody is known to read alone count for every daemon.
  ///
  /// @param process  as in `odometryd`, `camerad_front`; other programs read none.
  [[nodiscard]] std::string ReadBy(std::string_view process) const;

 private:
  std::map<std::string, std::string> sections_;
  std::map<std::string, std::string> cameras_;
};

}  // namespace relocd
