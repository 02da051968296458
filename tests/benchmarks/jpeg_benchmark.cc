#include <cstdint>
#include <random>
#include <vector>

#include <benchmark/benchmark.h>

#include "camera/jpeg.h"
#include "support/test_images.h"

namespace relocd {
namespace {

constexpr int kQuality = 80;

/// A smooth picture with noise: about as many bytes as a street scene.
GrayImage MakeNoisyImage(int width, int height) {
  std::mt19937 engine(17);
  GrayImage image = MakeTestImage(width, height);
  for (std::uint8_t& pixel : image.pixels)
    pixel = static_cast<std::uint8_t>(pixel + engine() % 12U);
  return image;
}

void BM_DecodeJpegToGray(benchmark::State& state) {
  const int width = static_cast<int>(state.range(0));
  const int height = static_cast<int>(state.range(1));
  const auto jpeg = EncodeGrayToJpeg(MakeNoisyImage(width, height), kQuality).value();
  for (auto _ : state)
    benchmark::DoNotOptimize(DecodeJpegToGray(jpeg));
  state.SetItemsProcessed(state.iterations() * width * height);
  state.counters["jpeg_bytes"] = static_cast<double>(jpeg.size());
}
BENCHMARK(BM_DecodeJpegToGray)->Args({416, 128})->Args({640, 480})->Args({1280, 720});

void BM_EncodeYuyvToJpeg(benchmark::State& state) {
  const int width = static_cast<int>(state.range(0));
  const int height = static_cast<int>(state.range(1));
  std::vector<std::uint8_t> yuyv;
  for (const std::uint8_t pixel : MakeNoisyImage(width, height).pixels) {
    constexpr std::uint8_t kGrey = 128;
    yuyv.push_back(pixel);
    yuyv.push_back(kGrey);
  }
  for (auto _ : state)
    benchmark::DoNotOptimize(EncodeYuyvToJpeg({yuyv, width, height, 2 * width}, kQuality));
  state.SetItemsProcessed(state.iterations() * width * height);
}
BENCHMARK(BM_EncodeYuyvToJpeg)->Args({640, 480})->Args({1280, 720});

void BM_FindWholeJpeg(benchmark::State& state) {
  const auto jpeg = MakeTestJpeg(640, 480);
  for (auto _ : state)
    benchmark::DoNotOptimize(FindWholeJpeg(jpeg));
}
BENCHMARK(BM_FindWholeJpeg);

}  // namespace
}  // namespace relocd
