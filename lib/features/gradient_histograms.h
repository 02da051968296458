#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include "core/result.h"
#include "core/thread_team.h"
#include "features/feature_extractor.h"
#include "features/gradient_maps.h"

namespace relocd {

/// Checks sizes and ranges. @return kInvalidInput, naming field, value and what is allowed.
Result<void> Validate(const GradientHistogramsConfig& config);

/// The configuration for images of this size: small images are enlarged, large ones reduced, to
/// about 0.33 megapixels, which is where cells of 8 pixels pay.
GradientHistogramsConfig GradientHistogramsForImage(int width, int height);

/// Values of one cell's feature.
int GradientHistogramsDimension(const GradientHistogramsConfig& config);

/// A hand-crafted dense extractor: for every octave a DAISY descriptor of 17 points x 8
/// orientations, divided by its sum and square-rooted, so that contrast cancels and strong edges do
/// not drown the rest.
///
/// In the coarser octaves, the 8 orientations are folded to 4: there the edges are those of houses
/// against the sky, or of shadows, and which side is the brighter one changes with the light.
class GradientHistograms final : public FeatureExtractor {
 public:
  /// @param team  does the work; features do not depend on its size.
  /// @return kInvalidInput for a configuration that Validate refuses.
  static Result<std::unique_ptr<GradientHistograms>> Create(
      const GradientHistogramsConfig& config, std::shared_ptr<ThreadTeam> team = TeamOfOne());

  [[nodiscard]] int dimension() const override;
  Result<void> Extract(const GrayImage& image,
                       std::size_t max_cells,
                       CellFeatures& features) override;

  /// For training, which changes the enlarged image before features are taken of it.
  /// @return kInvalidInput when the image has another size than the configuration says.
  [[nodiscard]] Result<void> Resize(const GrayImage& image, std::vector<float>& working) const;
  /// As Extract; `working` is working_width x working_height.
  void ExtractFromWorkingImage(std::span<const float> working,
                               std::size_t max_cells,
                               CellFeatures& features);

  /// Between pixels of the image and pixels of the working image.
  [[nodiscard]] Eigen::Vector2f ToWorking(const Eigen::Vector2f& pixel) const;
  [[nodiscard]] Eigen::Vector2f FromWorking(const Eigen::Vector2f& pixel) const;

  [[nodiscard]] const GradientHistogramsConfig& config() const { return config_; }
  /// Of the image that features were last taken of.
  [[nodiscard]] const GradientMaps& maps() const { return maps_; }

 private:
  struct Cell {
    float texture = 0.0F;
    int column = 0;
    int row = 0;
  };

  GradientHistograms(const GradientHistogramsConfig& config, std::shared_ptr<ThreadTeam> team)
      : config_(config), team_(std::move(team)) {}

  /// The features of one cell.
  void Describe(const Eigen::Vector2f& centre, std::span<float> feature) const;

  void ChooseCells(std::size_t max_cells);
  void AppendTile(int first_column, int first_row);
  [[nodiscard]] Eigen::Vector2f CellCentre(const Cell& cell) const;

  GradientHistogramsConfig config_;
  std::shared_ptr<ThreadTeam> team_;
  GradientMaps maps_;
  std::vector<float> working_;
  std::vector<Cell> cells_;
};

}  // namespace relocd
