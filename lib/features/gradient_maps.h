#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "core/thread_team.h"

namespace relocd {

/// How an image is turned into gradient histograms. Part of the map file: a head only understands
/// the features that it was trained on.
struct GradientHistogramsConfig {
  int image_width = 0;  ///< Of the images that are taken, in pixels.
  int image_height = 0;
  int working_width = 0;  ///< Images are resized to this; small images gain from being enlarged.
  int working_height = 0;
  int cell_stride = 8;  ///< Distance between cell centres, in working pixels.
  int octaves = 5;      ///< Each sees twice the surroundings of the one before.
};

/// Gradient orientations of one image, smoothed, at several octaves: where DAISY descriptors are
/// read from (Tola et al., "DAISY: an efficient dense descriptor applied to wide-baseline stereo",
/// 2010).
///
/// Buffers are kept between images, so that a second image of the same size allocates nothing.
/// Thread-bound.
class GradientMaps {
 public:
  static constexpr int kOrientations = 8;
  static constexpr int kPoints = 17;  ///< The centre and two rings of eight.
  static constexpr int kDescriptorSize = kPoints * kOrientations;

  /// @param pixels  row-major, width * height gray values in 0..255.
  /// @param team  does the work; the result does not depend on its size.
  void Compute(std::span<const float> pixels, int width, int height, int octaves, ThreadTeam& team);

  [[nodiscard]] int octaves() const { return static_cast<int>(octaves_.size()); }

  /// The histograms around a place of the image, summed gradient magnitudes, point by point.
  ///
  /// @param x, y  in pixels of the image that Compute was given; outside, the border is repeated.
  /// @param histogram  kDescriptorSize values.
  void Sample(int octave, float x, float y, std::span<float> histogram) const;

  /// How alike the histograms around a place are to `reference`: the sum of
  /// sqrt(reference) * sqrt(histogram), where both are first divided by their sums: 1 for equal
  /// ones (Bhattacharyya's coefficient).
  ///
  /// @param reference_roots  kDescriptorSize square roots of a histogram of sum 1.
  [[nodiscard]] float Affinity(int octave,
                               float x,
                               float y,
                               std::span<const float> reference_roots) const;

  /// The mean gradient magnitude near a place: how much texture there is.
  [[nodiscard]] float Texture(int octave, float x, float y) const;

 private:
  /// One octave: its image, and the orientation maps of which only every `step`-th pixel in both
  /// directions is kept.
  struct Octave {
    int image_width = 0;
    int image_height = 0;
    std::vector<float> image;
    int step = 2;
    int columns = 0;
    int rows = 0;
    std::vector<float> fine;    ///< rows x columns x kOrientations, for the centre and first ring.
    std::vector<float> coarse;  ///< The same, smoothed more, for the second ring.
  };

  struct GridPlace {
    int column = 0;
    int row = 0;
  };

  /// What a thread needs for the row that it works on.
  struct PartRows {
    std::vector<float> gx;
    std::vector<float> gy;
    std::vector<float> padded;
  };

  void ComputeOctave(Octave& octave, ThreadTeam& team);
  /// Rows of the image to smoothed_rows_.
  void SmoothOrientations(const Octave& octave,
                          std::span<const float> kernel,
                          PartRange rows,
                          PartRows& buffers);
  /// Rows of octave.fine to smoothed_rows_.
  void SmoothFine(const Octave& octave,
                  std::span<const float> kernel,
                  PartRange rows,
                  PartRows& buffers);
  [[nodiscard]] GridPlace PlaceInOctave(int octave, float x, float y) const;

  std::vector<Octave> octaves_;
  std::vector<float> smoothed_rows_;  ///< Smoothed along the row only.
  std::vector<PartRows> part_rows_;   ///< One a thread.
  ThreadTeam alone_{1};
};

}  // namespace relocd
