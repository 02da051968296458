#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "camera/intrinsics.h"
#include "core/result.h"
#include "geometry/pose3.h"

namespace relocd {

/// One image of a recorded drive, and where the camera was.
struct DatasetFrame {
  int index = 0;             ///< Row in frames.txt, counted from 0.
  std::string image_path;    ///< Can be opened as it is: begins with the data set's folder.
  std::string depth_path{};  ///< The same of its depth image; empty where there is none.
  std::int64_t time_ns = 0;  ///< In the recording's own time base; increases from frame to frame.
  Pose3 X_WC;                ///< Camera to the data set's world, in its unit (metres for drives).
};

/// A recorded drive with known camera poses: a folder with `frames.txt` (one image file a line),
/// `poses_tum.txt` (`time_s tx ty tz qx qy qz qw`, line i for image i), `intrinsics.txt`
/// (`fx fy cx cy width height [k1 k2 p1 p2 [k3]]`) and the images. `#` starts a comment.
/// Depth images, where there are any, are `depth/NAME.png` for the image `FOLDER/NAME.jpg`.
struct Dataset {
  std::string directory;
  CameraIntrinsics intrinsics;
  std::vector<DatasetFrame> frames;
};

/// Reads the three text files; the images are not opened, only which have a depth image is seen.
///
/// @return kInvalidInput with file and line, kUnavailable when a file cannot be read.
Result<Dataset> ReadDataset(const std::string& directory);

/// What a frame is for when a map is trained and measured.
enum class SplitPart { kTrain, kTest };

/// The part of each frame's index, from lines `index file train|test`.
///
/// @return kInvalidInput with file and line: a line of another form, an index that came before.
Result<std::map<int, SplitPart>> ReadSplit(const std::string& path);

/// The parsers behind the two, which take a file's text; `path` is for errors only.
Result<CameraIntrinsics> ParseIntrinsics(std::string_view text, const std::string& path);
Result<std::map<int, SplitPart>> ParseSplit(std::string_view text, const std::string& path);

}  // namespace relocd
