#include "rendering/png_image.h"

#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <png.h>

namespace relocd {
namespace {

/// libpng's reader of whole images, released whatever happens.
class PngReader {
 public:
  PngReader() { image_.version = PNG_IMAGE_VERSION; }
  PngReader(const PngReader&) = delete;
  PngReader& operator=(const PngReader&) = delete;
  PngReader(PngReader&&) = delete;
  PngReader& operator=(PngReader&&) = delete;
  ~PngReader() { png_image_free(&image_); }

  [[nodiscard]] png_image& image() { return image_; }
  [[nodiscard]] Error Failure() const {
    return {ErrorKind::kInvalidInput, std::string("PNG image: ") + image_.message};
  }

 private:
  png_image image_{};
};

}  // namespace

Result<RgbaImage> ReadPngImage(std::span<const std::uint8_t> bytes) {
  PngReader reader;
  png_image& png = reader.image();
  if (png_image_begin_read_from_memory(&png, bytes.data(), bytes.size()) == 0)
    return reader.Failure();
  if (auto ok = CheckRgbaSize(png.width, png.height); !ok)
    return std::move(ok).error().WithContext("PNG image");
  png.format = PNG_FORMAT_RGBA;
  RgbaImage image{.width = static_cast<int>(png.width),
                  .height = static_cast<int>(png.height),
                  .pixels = std::vector<std::uint8_t>(PNG_IMAGE_SIZE(png))};
  if (png_image_finish_read(&png, nullptr, image.pixels.data(), 0, nullptr) == 0)
    return reader.Failure();
  return image;
}

}  // namespace relocd
