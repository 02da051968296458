#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "camera/dataset.h"
#include "corner_tracks.h"
#include "input_check.h"
#include "track_geometry.h"

namespace relocd {

/// The parts of CheckInput. Each adds what it finds.
class InputFindings {
 public:
  void Warn(std::string about, std::string message) {
    list.push_back({InputSeverity::kWarning, std::move(about), std::move(message)});
  }
  void Refuse(std::string about, std::string message) {
    list.push_back({InputSeverity::kRefusal, std::move(about), std::move(message)});
  }

  std::vector<InputFinding> list;
};

/// `images/3.jpg to images/7.jpg, images/9.jpg and 12 more`.
std::string NameFrames(const Dataset& dataset, const std::vector<std::size_t>& frames);
/// The image's file as frames.txt has it.
std::string NameFrame(const Dataset& dataset, std::size_t frame);

/// 0 of nothing.
double MedianOf(std::vector<double> values);

/// Images that are missing, are none, or have another size than intrinsics.txt says; copies of one
/// another. @return whether all can be read.
bool CheckImageFiles(const Dataset& dataset, InputFindings& findings);

/// Too few frames, no motion, gaps, standing still, implausible speeds: by the poses alone.
void CheckRoute(const Dataset& dataset, InputSummary& summary, InputFindings& findings);

/// Blur, exposure, texture, images that hang, poses that hang.
void CheckImageQuality(const Dataset& dataset,
                       const TrackedDrive& drive,
                       InputSummary& summary,
                       InputFindings& findings);

/// In what numbers pieces of corner tracks are judged.
SegmentScale JudgingScale(const Dataset& dataset);

/// The poses' convention, the focal length, time offsets, single wrong poses, parallax, scale.
void CheckPoses(const Dataset& dataset,
                const TrackedDrive& drive,
                InputSummary& summary,
                InputFindings& findings);

/// Depth images that are missing or of another kind, and whether they are in millimetres: by the
/// corners whose distance follows from the poses. To be called when the poses are right.
void CheckDepthImages(const Dataset& dataset,
                      const TrackedDrive& drive,
                      InputSummary& summary,
                      InputFindings& findings);

}  // namespace relocd
