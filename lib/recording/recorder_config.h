#pragma once

#include <string>
#include <vector>

#include "core/result.h"

namespace relocd {

/// Where recorderd writes, and how much of the disk it may take.
struct RecorderConfig {
  std::string directory = "/var/log/relocd";
  int segment_mb = 256;
  int max_total_mb = 20000;
  int min_free_mb = 1000;
  double flush_s = 1.0;
  std::vector<std::string> exclude_channels;

  template <typename Self, typename Visitor>
  static void VisitFields(Self& self, Visitor&& visit) {
    visit("directory", self.directory, "must exist or be creatable");
    visit("segment_mb", self.segment_mb, "[1, 4096]; a file is closed at this size");
    visit("max_total_mb", self.max_total_mb, ">= segment_mb; the oldest segments go above it");
    visit("min_free_mb", self.min_free_mb, ">= 0; the oldest segments go below it");
    visit("flush_s", self.flush_s, "(0, 60]; at most this much is lost in a power cut");
    visit("exclude_channels", self.exclude_channels, "names, or prefixes ending in *");
  }

  /// @return kInvalidInput, naming the field, its value and what is allowed.
  [[nodiscard]] Result<void> Validate() const;
};

}  // namespace relocd
