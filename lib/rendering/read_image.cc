#include "rendering/read_image.h"

#include <string_view>
#include <utility>

#include "camera/jpeg.h"
#include "core/file.h"
#include "rendering/png_image.h"
#include "rendering/sgi_image.h"

namespace relocd {

Result<RgbaImage> ReadRgbaImage(const std::string& path) {
  const auto bytes = ReadFile(path);
  if (!bytes) return bytes.error();
  constexpr std::string_view kPngStart = "\x89PNG";
  constexpr std::string_view kSgiStart = "\x01\xda";
  const std::string_view text = *bytes;
  if (!text.starts_with(kPngStart) && !text.starts_with(kSgiStart))
    return Error{ErrorKind::kInvalidInput, path + ": is neither a PNG nor an SGI image"};
  auto image =
      text.starts_with(kPngStart) ? ReadPngImage(AsBytes(text)) : ReadSgiImage(AsBytes(text));
  if (!image) return std::move(image).error().WithContext(path);
  return image;
}

}  // namespace relocd
