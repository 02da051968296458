#pragma once

#include <random>
#include <span>

namespace relocd {

/// How much the light of training images is changed, so that a map also knows its places at other
/// times of the day. All are the largest changes; each image gets less.
struct LightChanges {
  double contrast = 1.8;  ///< >= 1; a factor or its inverse.
  double gamma = 2.0;     ///< >= 1; an exponent or its inverse.
  double shading = 0.7;   ///< >= 0; logarithm of a factor that varies slowly over the image.
  int shadows = 3;        ///< >= 0; edges of cast shadows.
  double haze = 0.35;     ///< In [0, 1); part of the contrast that is lost.
  double noise = 6.0;     ///< >= 0; standard deviation, gray levels.
  int occluders = 3;      ///< >= 0; patches of the image put where others are.
};

/// Changes the light of an image as another hour, another weather and others on the road would.
///
/// @param pixels  height x width gray levels in [0, 255], row-major; changed in place, and not
///                clamped again where noise was added.
void ChangeLight(const LightChanges& changes,
                 std::mt19937_64& engine,
                 int width,
                 int height,
                 std::span<float> pixels);

}  // namespace relocd
