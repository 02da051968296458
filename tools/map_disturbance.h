#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "camera/image.h"
#include "core/result.h"

namespace relocd {

/// What a camera, the light or things in front of the lens do to a picture: to see how much of it a
/// map bears.
enum class Disturbance {
  kNone,
  kGamma,      ///< Of 1.8: middle tones get darker.
  kDark,       ///< Half the brightness.
  kBlur,       ///< With a standard deviation of 2 px in a picture of 640 x 480, in proportion else.
  kNoise,      ///< With a standard deviation of 12 of 255.
  kOccluders,  ///< Four gray rectangles, 200 x 150 px in a picture of 640 x 480, in proportion
               ///< else.
};

/// `none`, `gamma`, `dark`, `blur`, `noise`, `occluders`. @return kInvalidInput, naming them.
Result<Disturbance> ParseDisturbance(const std::string& name);

/// @param seed  of noise and of where rectangles are.
GrayImage Disturb(const GrayImage& image, Disturbance disturbance, std::uint64_t seed);

/// Left and right exchanged.
GrayImage Mirror(const GrayImage& image);

/// The largest part in the middle that has the wanted sides' ratio, resized.
GrayImage FitSize(const GrayImage& image, int width, int height);

}  // namespace relocd
