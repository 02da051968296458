#include <cmath>
#include <cstdint>
#include <functional>
#include <map>
#include <unordered_map>
#include <utility>

#include <fmt/format.h>

#include "camera/jpeg.h"
#include "core/file.h"
#include "input_check_parts.h"

namespace relocd {
namespace {

/// What is learned from the images' files.
struct ImageFiles {
  std::vector<std::size_t> missing;
  std::vector<std::size_t> broken;
  std::string first_broken;                                       ///< Why.
  std::map<std::pair<int, int>, std::vector<std::size_t>> sizes;  ///< Frames by width and height.
  std::vector<std::size_t> copies;                                ///< The same bytes as one before.
};

ImageFiles ReadImageFiles(const Dataset& dataset) {
  ImageFiles files;
  std::unordered_map<std::size_t, std::size_t> seen;
  for (std::size_t frame = 0; frame < dataset.frames.size(); ++frame) {
    const auto bytes = ReadFile(dataset.frames[frame].image_path);
    if (!bytes) {
      files.missing.push_back(frame);
      continue;
    }
    const auto size = ReadJpegSize(AsBytes(*bytes));
    if (!size) {
      if (files.broken.empty()) files.first_broken = size.error().message;
      files.broken.push_back(frame);
      continue;
    }
    files.sizes[{size->width, size->height}].push_back(frame);
    const bool is_new = seen.emplace(std::hash<std::string>{}(*bytes), frame).second;
    if (!is_new) files.copies.push_back(frame);
  }
  return files;
}

/// Images that have not the size of intrinsics.txt.
void CheckSizes(const Dataset& dataset, const ImageFiles& files, InputFindings& findings) {
  const CameraIntrinsics& camera = dataset.intrinsics;
  const std::pair<int, int> wanted(camera.width, camera.height);
  for (const auto& [size, frames] : files.sizes) {
    if (size == wanted) continue;
    const std::string what = frames.size() == dataset.frames.size()
                                 ? std::string("all images are")
                                 : fmt::format("{} of {} images are ({})",
                                               frames.size(),
                                               dataset.frames.size(),
                                               NameFrames(dataset, frames));
    findings.Refuse(
        "size",
        fmt::format("{} {} x {} pixels, must be {} x {} as intrinsics.txt says: take the images "
                    "of one camera at one size, and its calibration at that size",
                    what,
                    size.first,
                    size.second,
                    camera.width,
                    camera.height));
  }
}

}  // namespace

bool CheckImageFiles(const Dataset& dataset, InputFindings& findings) {
  const ImageFiles files = ReadImageFiles(dataset);
  if (!files.missing.empty()) {
    findings.Refuse("images",
                    fmt::format("{} of {} images are missing ({}): copy them into the folder, or "
                                "take their rows out of frames.txt and poses_tum.txt",
                                files.missing.size(),
                                dataset.frames.size(),
                                NameFrames(dataset, files.missing)));
  }
  if (!files.broken.empty()) {
    findings.Refuse("images",
                    fmt::format("{} of {} images cannot be read ({}: {}): copy them again, or take "
                                "their rows out of frames.txt and poses_tum.txt",
                                files.broken.size(),
                                dataset.frames.size(),
                                NameFrames(dataset, files.broken),
                                files.first_broken));
  }
  CheckSizes(dataset, files, findings);
  if (!files.copies.empty()) {
    const std::string message = fmt::format(
        "{} of {} images are copies of earlier ones, byte for byte ({}): the recording "
        "hung or was put together wrongly; take the copies' rows out",
        files.copies.size(),
        dataset.frames.size(),
        NameFrames(dataset, files.copies));
    constexpr std::size_t kTooMany = 4;  // one of so many
    if (kTooMany * files.copies.size() > dataset.frames.size()) {
      findings.Refuse("duplicates", message);
    } else {
      findings.Warn("duplicates", message);
    }
  }
  return files.missing.empty() && files.broken.empty() && files.sizes.size() == 1 &&
         files.sizes.begin()->first ==
             std::pair<int, int>(dataset.intrinsics.width, dataset.intrinsics.height);
}

}  // namespace relocd
