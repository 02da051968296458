#pragma once

#include <cmath>
#include <cstddef>
#include <string>
#include <utility>

#include <fmt/format.h>

#include "camera/dataset.h"
#include "camera/jpeg.h"
#include "scene_coordinates/wall_scene.h"
#include "support/temporary_folder.h"

namespace relocd {

/// A drive past the wall on a winding path, looking about, with all that a data set has.
class WallDrive {
 public:
  static constexpr int kFrames = 44;

  /// Turns all that can be told by turns: 0.3 rad from side to side, a little up and down.
  static Pose3 PoseAt(double i) {
    return {RotationFromRollPitchYaw(0.06 * std::sin(0.4 * i), 0.3 * std::sin(0.3 * i), 0.0),
            {0.25 * i, 0.15 * std::sin(0.2 * i), 0.3 * std::sin(0.23 * i)}};
  }

  explicit WallDrive(int frames = kFrames) : WallDrive(PoseAt, frames) {}

  /// @param pose_at  of the camera by the frame's number.
  template <typename PoseFunction>
  WallDrive(const PoseFunction& pose_at, int frames) {
    dataset_.directory = folder_.path();
    dataset_.intrinsics = WallScene::Intrinsics();
    for (int i = 0; i < frames; ++i) {
      const Pose3 X_WC = pose_at(i);
      const std::string name = fmt::format("images/{:02}.jpg", i);
      constexpr std::int64_t kPeriod_ns = 100'000'000;
      dataset_.frames.push_back({.index = i,
                                 .image_path = folder_.path() + "/" + name,
                                 .time_ns = i * kPeriod_ns,
                                 .X_WC = X_WC});
      WriteImage(static_cast<std::size_t>(i), scene_.View(X_WC).image);
    }
  }

  [[nodiscard]] Dataset& dataset() { return dataset_; }
  [[nodiscard]] const TemporaryFolder& folder() const { return folder_; }

  [[nodiscard]] GrayImage Image(std::size_t frame) const {
    return ReadGrayImage(dataset_.frames[frame].image_path).value();
  }
  void WriteImage(std::size_t frame, const GrayImage& image) const {
    constexpr int kQuality = 95;
    const auto jpeg = EncodeGrayToJpeg(image, kQuality).value();
    folder_.Write(dataset_.frames[frame].image_path.substr(folder_.path().size() + 1),
                  {reinterpret_cast<const char*>(jpeg.data()), jpeg.size()});
  }

  /// Replaces these images by what `change` makes of them.
  template <typename Change>
  void ChangeImages(std::size_t begin, std::size_t end, const Change& change) {
    for (std::size_t frame = begin; frame < end; ++frame)
      WriteImage(frame, change(Image(frame)));
  }

 private:
  TemporaryFolder folder_;
  WallScene scene_;
  Dataset dataset_;
};

}  // namespace relocd
