#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "camera/intrinsics.h"
#include "can/candump_log.h"
#include "core/result.h"
#include "geometry/trajectory.h"
#include "recording/log_writer.h"
#include "simulation/wheel_motion.h"

namespace relocd {

/// All of a simulated drive but its images, which come one by one.
struct DriveRecord {
  std::string camera = "front";
  CameraIntrinsics intrinsics;
  Trajectory3 X_WCs;  ///< Of each image that will come; empty for a drive without images.
  std::vector<WheelMotion> motions;
  std::vector<CandumpRecord> can_frames;
  std::string can_interface = "can0";
  std::map<std::string, std::string> texts;  ///< Further files of the folder: content by name.
};

/// Writes a simulated drive into a folder: a data set with its truth (docs/datasets.md), a CAN log,
/// and `drive.lcmlog`, in which the messages of camerad and odometryd are.
///
/// Everything goes into FOLDER.partial, which becomes FOLDER when all is there. A drive that was
/// interrupted, or did not fit onto the disk, stays under that name, and every error says so.
class DriveWriter {
 public:
  /// Whether a drive can be written there: for knowing before anything is simulated.
  ///
  /// @return kInvalidInput when the folder exists, or FOLDER.partial does and is something else.
  static Result<void> Check(const std::string& folder);

  /// Writes all that needs no image. What an interrupted drive left in FOLDER.partial goes.
  ///
  /// @return kInvalidInput, as Check; kUnavailable when it cannot be written.
  static Result<DriveWriter> Create(const std::string& folder, DriveRecord record);

  /// The next image.
  Result<void> AddImage(std::span<const std::uint8_t> jpeg);

  /// Where the depth image of the last one is to be written.
  Result<std::string> MakeDepthPath() const;

  /// To be called when all images are there: writes the rest, and gives the folder its name.
  Result<void> Finish();

  /// What went wrong meanwhile, with where the part of the drive is that there is.
  [[nodiscard]] Error Incomplete(Error error) const;

 private:
  DriveWriter(std::string folder, DriveRecord record, LogWriter log);

  Result<void> WriteTexts() const;
  /// Messages with what the bus carried before a time.
  Result<void> LogCanBefore(std::int64_t time_ns);
  Result<void> LogImage(std::span<const std::uint8_t> jpeg);
  /// The same with where the part is, if it failed.
  [[nodiscard]] Result<void> Explain(Result<void> result) const;

  std::string folder_;
  std::string partial_;
  DriveRecord record_;
  LogWriter log_;
  std::size_t images_ = 0;      ///< Written.
  std::size_t can_frames_ = 0;  ///< In the log.
  std::int64_t can_batches_ = 0;
};

/// The file of an image, and of its depth image, relative to the folder.
std::string DriveImageName(std::size_t index);
std::string DriveDepthName(std::size_t index);

}  // namespace relocd
