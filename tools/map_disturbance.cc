#include "map_disturbance.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <string_view>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <opencv2/imgproc.hpp>

namespace relocd {
namespace {

constexpr std::array<std::pair<std::string_view, Disturbance>, 6> kNames = {{
    {"none", Disturbance::kNone},
    {"gamma", Disturbance::kGamma},
    {"dark", Disturbance::kDark},
    {"blur", Disturbance::kBlur},
    {"noise", Disturbance::kNoise},
    {"occluders", Disturbance::kOccluders},
}};

/// Applies a function to each value, rounded and kept in range.
template <typename Function>
void ChangeValues(GrayImage& image, const Function& function) {
  std::transform(
      image.pixels.begin(), image.pixels.end(), image.pixels.begin(), [&](std::uint8_t value) {
        return static_cast<std::uint8_t>(std::clamp(std::lround(function(value)), 0L, 255L));
      });
}

/// A lens out of focus spreads light over a part of the picture, however many pixels are there.
void Blur(GrayImage& image) {
  constexpr double kSigmaPx = 2.0;
  constexpr double kPixels = 640.0 * 480.0;
  const double sigma_px = kSigmaPx * std::sqrt(image.width * image.height / kPixels);
  const cv::Mat view(image.height, image.width, CV_8U, image.pixels.data());
  cv::Mat blurred;
  cv::GaussianBlur(view, blurred, {0, 0}, sigma_px);
  std::copy(blurred.begin<std::uint8_t>(), blurred.end<std::uint8_t>(), image.pixels.begin());
}

void Cover(GrayImage& image, std::mt19937_64& engine) {
  constexpr int kRectangles = 4;
  constexpr double kWidthShare = 200.0 / 640.0;
  constexpr double kHeightShare = 150.0 / 480.0;
  const int width = static_cast<int>(kWidthShare * image.width);
  const int height = static_cast<int>(kHeightShare * image.height);
  cv::Mat view(image.height, image.width, CV_8U, image.pixels.data());
  for (int index = 0; index < kRectangles; ++index) {
    const int left = std::uniform_int_distribution(0, image.width - width)(engine);
    const int top = std::uniform_int_distribution(0, image.height - height)(engine);
    const int gray = std::uniform_int_distribution(0, 255)(engine);
    cv::rectangle(view, {left, top, width, height}, cv::Scalar(gray), cv::FILLED);
  }
}

}  // namespace

Result<Disturbance> ParseDisturbance(const std::string& name) {
  std::vector<std::string_view> names;
  for (const auto& [known, disturbance] : kNames) {
    if (name == known) return disturbance;
    names.push_back(known);
  }
  return Error{ErrorKind::kInvalidInput,
               fmt::format("--disturb is '{}', must be one of {}", name, fmt::join(names, ", "))};
}

GrayImage Disturb(const GrayImage& image, Disturbance disturbance, std::uint64_t seed) {
  GrayImage out = image;
  std::mt19937_64 engine(seed);
  std::normal_distribution<double> noise(0.0, 12.0);
  switch (disturbance) {
    case Disturbance::kNone:
      break;
    case Disturbance::kGamma:
      ChangeValues(out, [](double value) { return 255.0 * std::pow(value / 255.0, 1.8); });
      break;
    case Disturbance::kDark:
      ChangeValues(out, [](double value) { return 0.5 * value; });
      break;
    case Disturbance::kBlur:
      Blur(out);
      break;
    case Disturbance::kNoise:
      ChangeValues(out, [&](double value) { return value + noise(engine); });
      break;
    case Disturbance::kOccluders:
      Cover(out, engine);
      break;
  }
  return out;
}

GrayImage Mirror(const GrayImage& image) {
  GrayImage mirrored = image;
  for (auto row = mirrored.pixels.begin(); row != mirrored.pixels.end(); row += image.width) {
    std::reverse(row, row + image.width);
  }
  return mirrored;
}

GrayImage FitSize(const GrayImage& image, int width, int height) {
  const double scale = std::min(static_cast<double>(image.width) / width,
                                static_cast<double>(image.height) / height);
  const int part_width = std::max(1, static_cast<int>(scale * width));
  const int part_height = std::max(1, static_cast<int>(scale * height));
  GrayImage out{.width = width, .height = height, .pixels = {}};
  out.pixels.resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  // OpenCV has no view of constant memory; nothing is written to the input.
  const cv::Mat view(
      image.height, image.width, CV_8U, const_cast<std::uint8_t*>(image.pixels.data()));
  const cv::Rect part(
      (image.width - part_width) / 2, (image.height - part_height) / 2, part_width, part_height);
  cv::Mat resized(height, width, CV_8U, out.pixels.data());
  cv::resize(view(part), resized, resized.size(), 0.0, 0.0, cv::INTER_AREA);
  return out;
}

}  // namespace relocd
