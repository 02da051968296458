#include "camera/jpeg.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <memory>
#include <utility>

#include <fmt/format.h>
#include <turbojpeg.h>

#include "core/file.h"

namespace relocd {
namespace {

constexpr std::size_t kMarkerSize = 2;
constexpr int kDecodeFlags = TJFLAG_LIMITSCANS;  // a progressive JPEG may ask for hours of scans

struct DestroyTurbo {
  void operator()(void* handle) const { tjDestroy(handle); }
};
using TurboHandle = std::unique_ptr<void, DestroyTurbo>;

struct FreeTurbo {
  void operator()(unsigned char* bytes) const { tjFree(bytes); }
};

Error Invalid(std::string message) {
  return {ErrorKind::kInvalidInput, std::move(message)};
}

Result<TurboHandle> Checked(tjhandle handle) {
  if (handle == nullptr) {
    return Error{ErrorKind::kInternal, fmt::format("libturbojpeg: {}", tjGetErrorStr2(nullptr))};
  }
  return TurboHandle(handle);
}

Result<void> CheckSize(std::string_view doing, int width, int height) {
  const bool fits = width >= 1 && height >= 1 && width <= kMaxImageSide &&
                    height <= kMaxImageSide && std::int64_t{width} * height <= kMaxImagePixels;
  if (fits) return {};
  return Invalid(
      fmt::format("{}: the image is {} x {} px, must have sides in [1, {}] and at most {} pixels",
                  doing,
                  width,
                  height,
                  kMaxImageSide,
                  kMaxImagePixels));
}

Result<void> CheckQuality(int quality) {
  if (quality >= 1 && quality <= 100) return {};
  return Invalid(fmt::format("encoding JPEG: the quality is {}, must be in [1, 100]", quality));
}

Result<JpegSize> ReadHeader(tjhandle handle, std::span<const std::uint8_t> jpeg) {
  JpegSize size;
  int subsampling = 0;
  int colour_space = 0;
  if (tjDecompressHeader3(handle,
                          jpeg.data(),
                          jpeg.size(),
                          &size.width,
                          &size.height,
                          &subsampling,
                          &colour_space) != 0) {
    return Invalid(fmt::format(
        "decoding JPEG: {} bytes are no JPEG ({})", jpeg.size(), tjGetErrorStr2(handle)));
  }
  if (auto fits = CheckSize("decoding JPEG", size.width, size.height); !fits) {
    return std::move(fits).error();
  }
  return size;
}

/// Whether the image is whole in spite of libjpeg's warning. Many USB cameras put filler bytes
/// before restart markers, of which libjpeg warns and which it skips.
bool IsHarmlessWarning(tjhandle handle) {
  return tjGetErrorCode(handle) == TJERR_WARNING &&
         std::string_view(tjGetErrorStr2(handle)).find("extraneous bytes before marker") !=
             std::string_view::npos;
}

/// @param failed  what decompressing returned.
Result<void> CheckDecoded(int failed, tjhandle handle, std::size_t bytes, const JpegSize& size) {
  if (failed == 0 || IsHarmlessWarning(handle)) return {};
  return Invalid(fmt::format("decoding JPEG: {} bytes of {} x {} px are damaged ({})",
                             bytes,
                             size.width,
                             size.height,
                             tjGetErrorStr2(handle)));
}

std::uint8_t ToByte(double value) {
  return static_cast<std::uint8_t>(std::lround(std::clamp(value, 0.0, 255.0)));
}

/// Packs an even number of pixels with the weights of JPEG: ITU-R BT.601, full range.
std::vector<std::uint8_t> YuyvFromRgb(std::span<const std::uint8_t> rgb) {
  std::vector<std::uint8_t> yuyv;
  yuyv.reserve(rgb.size() / 3 * 2);
  for (std::size_t i = 0; i + 5 < rgb.size(); i += 6) {
    const auto brightness = [&](std::size_t at) {
      return 0.299 * rgb[at] + 0.587 * rgb[at + 1] + 0.114 * rgb[at + 2];
    };
    const double first = brightness(i);
    const double second = brightness(i + 3);
    const double mean = 0.5 * (first + second);
    const double blue = 0.5 * (rgb[i + 2] + rgb[i + 5]);
    const double red = 0.5 * (rgb[i] + rgb[i + 3]);
    yuyv.push_back(ToByte(first));
    yuyv.push_back(ToByte(128.0 + 0.564 * (blue - mean)));
    yuyv.push_back(ToByte(second));
    yuyv.push_back(ToByte(128.0 + 0.713 * (red - mean)));
  }
  return yuyv;
}

std::vector<std::uint8_t> CopyOut(const unsigned char* bytes, unsigned long size) {
  return {bytes, bytes + size};
}

/// The three planes of a YUYV image, one after the other.
struct Planes {
  std::vector<std::uint8_t> y, u, v;
};

Planes SplitPlanes(const YuyvView& image) {
  const auto pairs = static_cast<std::size_t>(image.width) / 2;
  Planes planes;
  for (auto* plane : {&planes.y, &planes.u, &planes.v}) {
    plane->reserve(pairs * 2 * static_cast<std::size_t>(image.height));
  }
  for (int v = 0; v < image.height; ++v) {
    const auto row = image.bytes.subspan(static_cast<std::size_t>(v) *
                                         static_cast<std::size_t>(image.bytes_per_line));
    for (std::size_t pair = 0; pair < pairs; ++pair) {
      planes.y.push_back(row[4 * pair]);
      planes.u.push_back(row[4 * pair + 1]);
      planes.y.push_back(row[4 * pair + 2]);
      planes.v.push_back(row[4 * pair + 3]);
    }
  }
  return planes;
}

Result<void> CheckYuyv(const YuyvView& image) {
  if (auto fits = CheckSize("encoding YUYV to JPEG", image.width, image.height); !fits) return fits;
  if (image.width % 2 != 0 || image.bytes_per_line < 2 * image.width) {
    return Invalid(fmt::format(
        "encoding YUYV to JPEG: the width is {} px with {} bytes a line, must be even with at "
        "least 2 bytes a pixel",
        image.width,
        image.bytes_per_line));
  }
  const std::int64_t needed =
      std::int64_t{image.bytes_per_line} * (image.height - 1) + std::int64_t{2} * image.width;
  if (std::ssize(image.bytes) < needed) {
    return Invalid(fmt::format("encoding YUYV to JPEG: {} bytes for {} x {} px, must be {}",
                               image.bytes.size(),
                               image.width,
                               image.height,
                               needed));
  }
  return {};
}

/// Pixels as libjpeg-turbo takes them: row-major, without padding.
struct Pixels {
  std::span<const std::uint8_t> pixels;
  int width = 0;
  int height = 0;
  int channels = 1;
  int format = TJPF_GRAY;
  int subsampling = TJSAMP_GRAY;
};

Result<std::vector<std::uint8_t>> EncodePixels(const Pixels& image, int quality) {
  if (auto fits = CheckSize("encoding JPEG", image.width, image.height); !fits) {
    return std::move(fits).error();
  }
  const std::int64_t needed = std::int64_t{image.width} * image.height * image.channels;
  if (std::ssize(image.pixels) != needed) {
    return Invalid(fmt::format("encoding JPEG: {} bytes for {} x {} px, must be {}",
                               image.pixels.size(),
                               image.width,
                               image.height,
                               needed));
  }
  if (auto valid = CheckQuality(quality); !valid) return std::move(valid).error();
  auto handle = Checked(tjInitCompress());
  if (!handle) return std::move(handle).error();
  unsigned char* bytes = nullptr;
  unsigned long size = 0;
  const int failed = tjCompress2(handle->get(),
                                 image.pixels.data(),
                                 image.width,
                                 image.width * image.channels,
                                 image.height,
                                 image.format,
                                 &bytes,
                                 &size,
                                 image.subsampling,
                                 quality,
                                 0);
  const std::unique_ptr<unsigned char, FreeTurbo> owned(bytes);
  if (failed != 0) {
    return Error{ErrorKind::kInternal,
                 fmt::format("encoding JPEG: {}", tjGetErrorStr2(handle->get()))};
  }
  return CopyOut(bytes, size);
}

}  // namespace

std::optional<std::span<const std::uint8_t>> FindWholeJpeg(std::span<const std::uint8_t> buffer) {
  while (!buffer.empty() && buffer.back() == 0)
    buffer = buffer.first(buffer.size() - 1);
  constexpr std::array<std::uint8_t, kMarkerSize> kStart{0xFF, 0xD8};
  constexpr std::array<std::uint8_t, kMarkerSize> kEnd{0xFF, 0xD9};
  if (buffer.size() < 2 * kMarkerSize) return std::nullopt;
  if (!std::ranges::equal(buffer.first(kMarkerSize), kStart)) return std::nullopt;
  if (!std::ranges::equal(buffer.last(kMarkerSize), kEnd)) return std::nullopt;
  return buffer;
}

Result<JpegSize> ReadJpegSize(std::span<const std::uint8_t> jpeg) {
  auto handle = Checked(tjInitDecompress());
  if (!handle) return std::move(handle).error();
  return ReadHeader(handle->get(), jpeg);
}

Result<GrayImage> DecodeJpegToGray(std::span<const std::uint8_t> jpeg) {
  auto handle = Checked(tjInitDecompress());
  if (!handle) return std::move(handle).error();
  auto size = ReadHeader(handle->get(), jpeg);
  if (!size) return std::move(size).error();
  GrayImage image{.width = size->width, .height = size->height, .pixels = {}};
  image.pixels.resize(static_cast<std::size_t>(image.width) *
                      static_cast<std::size_t>(image.height));
  const int failed = tjDecompress2(handle->get(),
                                   jpeg.data(),
                                   jpeg.size(),
                                   image.pixels.data(),
                                   image.width,
                                   image.width,
                                   image.height,
                                   TJPF_GRAY,
                                   kDecodeFlags);
  if (auto ok = CheckDecoded(failed, handle->get(), jpeg.size(), *size); !ok) {
    return std::move(ok).error();
  }
  return image;
}

Result<std::vector<std::uint8_t>> DecodeJpegToYuyv(std::span<const std::uint8_t> jpeg) {
  auto handle = Checked(tjInitDecompress());
  if (!handle) return std::move(handle).error();
  auto size = ReadHeader(handle->get(), jpeg);
  if (!size) return std::move(size).error();
  if (size->width % 2 != 0) {
    return Invalid(
        fmt::format("decoding JPEG to YUYV: the width is {} px, must be even", size->width));
  }
  std::vector<std::uint8_t> rgb(3 * static_cast<std::size_t>(size->width) *
                                static_cast<std::size_t>(size->height));
  const int failed = tjDecompress2(handle->get(),
                                   jpeg.data(),
                                   jpeg.size(),
                                   rgb.data(),
                                   size->width,
                                   3 * size->width,
                                   size->height,
                                   TJPF_RGB,
                                   kDecodeFlags);
  if (auto ok = CheckDecoded(failed, handle->get(), jpeg.size(), *size); !ok) {
    return std::move(ok).error();
  }
  return YuyvFromRgb(rgb);
}

Result<std::vector<std::uint8_t>> EncodeGrayToJpeg(const GrayImage& image, int quality) {
  return EncodePixels({.pixels = image.pixels,
                       .width = image.width,
                       .height = image.height,
                       .channels = 1,
                       .format = TJPF_GRAY,
                       .subsampling = TJSAMP_GRAY},
                      quality);
}

Result<std::vector<std::uint8_t>> EncodeRgbToJpeg(const RgbImage& image, int quality) {
  return EncodePixels({.pixels = image.pixels,
                       .width = image.width,
                       .height = image.height,
                       .channels = 3,
                       .format = TJPF_RGB,
                       .subsampling = TJSAMP_420},
                      quality);
}

Result<std::vector<std::uint8_t>> EncodeYuyvToJpeg(const YuyvView& image, int quality) {
  if (auto valid = CheckYuyv(image); !valid) return std::move(valid).error();
  if (auto valid = CheckQuality(quality); !valid) return std::move(valid).error();
  auto handle = Checked(tjInitCompress());
  if (!handle) return std::move(handle).error();
  const Planes planes = SplitPlanes(image);
  std::array<const unsigned char*, 3> starts{planes.y.data(), planes.u.data(), planes.v.data()};
  const std::array<int, 3> strides{image.width, image.width / 2, image.width / 2};
  unsigned char* bytes = nullptr;
  unsigned long size = 0;
  const int failed = tjCompressFromYUVPlanes(handle->get(),
                                             starts.data(),
                                             image.width,
                                             strides.data(),
                                             image.height,
                                             TJSAMP_422,
                                             &bytes,
                                             &size,
                                             quality,
                                             0);
  const std::unique_ptr<unsigned char, FreeTurbo> owned(bytes);
  if (failed != 0) {
    return Error{ErrorKind::kInternal,
                 fmt::format("encoding YUYV to JPEG: {}", tjGetErrorStr2(handle->get()))};
  }
  return CopyOut(bytes, size);
}

Result<GrayImage> ReadGrayImage(const std::string& path) {
  const auto text = ReadFile(path);
  if (!text) return text.error();
  auto image = DecodeJpegToGray(AsBytes(*text));
  if (!image) return std::move(image).error().WithContext(path);
  return image;
}

}  // namespace relocd
