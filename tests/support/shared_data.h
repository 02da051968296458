#pragma once

#include <cstdlib>
#include <filesystem>
#include <string>

namespace relocd {

/// The folder of a data set that is measured on but not part of the project: `$RELOCD_DATA/NAME`,
/// else `../shared/data/NAME` beside the source tree. Empty when it is not there:
/// `if (folder.empty()) GTEST_SKIP() << SharedDataReason("kitti00_head");`
inline std::string SharedData(const std::string& name) {
  const char* root = std::getenv("RELOCD_DATA");  // NOLINT(concurrency-mt-unsafe): one thread
  const std::filesystem::path folder =
      root != nullptr ? std::filesystem::path(root)
                      : std::filesystem::path(RELOCD_SOURCE_DIR) / ".." / "shared" / "data";
  std::error_code ignored;
  const auto path = (folder / name).lexically_normal();
  return std::filesystem::exists(path, ignored) ? path.string() : std::string();
}

inline std::string SharedDataReason(const std::string& name) {
  return "the data set " + name + " is neither in $RELOCD_DATA nor in ../shared/data";
}

}  // namespace relocd
