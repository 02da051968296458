#include "scene_coordinates/light_changes.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include <opencv2/imgproc.hpp>

namespace relocd {
namespace {

constexpr double kWhite = 255.0;

class Draws {
 public:
  explicit Draws(std::mt19937_64& engine) : engine_(engine) {}
  double Symmetric() { return std::uniform_real_distribution<double>(-1.0, 1.0)(engine_); }
  double Unit() { return std::uniform_real_distribution<double>(0.0, 1.0)(engine_); }
  int Below(int bound) { return std::min(bound - 1, static_cast<int>(bound * Unit())); }

 private:
  std::mt19937_64& engine_;
};

/// A factor that varies over the image like the light of a sky with clouds.
void Shade(double strength, Draws& draws, cv::Mat& image) {
  cv::Mat coarse(4, 5, CV_32F);
  for (auto value = coarse.begin<float>(); value != coarse.end<float>(); ++value)
    *value = static_cast<float>(strength * draws.Symmetric());
  cv::Mat shading;
  cv::resize(coarse, shading, image.size(), 0.0, 0.0, cv::INTER_CUBIC);
  cv::exp(shading, shading);
  cv::multiply(image, shading, image);
}

/// Darkens what lies within a triangle or a strip, with a soft edge: as trees and houses do.
void CastShadow(Draws& draws, cv::Mat& image) {
  cv::Mat shadow(image.size(), CV_32F, cv::Scalar(1.0));
  const auto point = [&] {
    return cv::Point(static_cast<int>(image.cols * (1.5 * draws.Unit() - 0.25)),
                     static_cast<int>(image.rows * (1.5 * draws.Unit() - 0.25)));
  };
  std::vector<cv::Point> corners{point(), point(), point()};
  if (draws.Unit() < 0.5) corners.push_back(point());
  const double factor = 0.25 + 0.55 * draws.Unit();
  cv::fillConvexPoly(shadow, corners, cv::Scalar(factor));
  const double softness_px = 0.6 + 2.0 * draws.Unit();
  cv::GaussianBlur(shadow, shadow, {0, 0}, softness_px);
  cv::multiply(image, shadow, image);
}

/// Puts a part of the image somewhere else, as a car or a person would hide what is there.
void Occlude(Draws& draws, cv::Mat& image) {
  const int width = image.cols * (4 + draws.Below(14)) / 100;
  const int height = image.rows * (6 + draws.Below(20)) / 100;
  const cv::Rect from(
      draws.Below(image.cols - width), draws.Below(image.rows - height), width, height);
  const cv::Rect to(
      draws.Below(image.cols - width), draws.Below(image.rows - height), width, height);
  image(from).clone().copyTo(image(to));
}

}  // namespace

void ChangeLight(const LightChanges& changes,
                 std::mt19937_64& engine,
                 int width,
                 int height,
                 std::span<float> pixels) {
  cv::Mat image(height, width, CV_32F, pixels.data());
  Draws draws(engine);
  for (int i = draws.Below(changes.occluders + 1); i > 0; --i)
    Occlude(draws, image);
  for (int i = draws.Below(changes.shadows + 1); i > 0; --i)
    CastShadow(draws, image);
  Shade(changes.shading * draws.Unit(), draws, image);
  const double contrast = std::pow(changes.contrast, draws.Symmetric());
  const double gamma = std::pow(changes.gamma, draws.Symmetric());
  const double haze = changes.haze * draws.Unit() * draws.Unit();
  const double haze_gray = kWhite * (0.4 + 0.5 * draws.Unit());
  cv::max(image * (1.0 / kWhite), 0.0, image);
  cv::pow(image, gamma, image);
  image.convertTo(image, CV_32F, kWhite * contrast * (1.0 - haze), haze * haze_gray);
  // Cameras do not see what is brighter than white.
  cv::min(image, kWhite, image);
  const double noise = changes.noise * draws.Unit() * draws.Unit();
  cv::Mat grain(image.size(), CV_32F);
  cv::RNG random(engine());
  random.fill(grain, cv::RNG::NORMAL, 0.0, noise);
  image += grain;
}

}  // namespace relocd
