#include "camera/intrinsics.h"

#include <cmath>
#include <string_view>

#include <fmt/format.h>

#include "camera/jpeg.h"

namespace relocd {
namespace {

Error Bad(std::string_view field, double value, std::string_view allowed) {
  return {ErrorKind::kInvalidInput, fmt::format("{} is {}, must be {}", field, value, allowed)};
}

}  // namespace

Result<void> CameraIntrinsics::Validate() const {
  if (width < 1 || width > kMaxImageSide) {
    return Bad("width", width, fmt::format("in [1, {}]", kMaxImageSide));
  }
  if (height < 1 || height > kMaxImageSide) {
    return Bad("height", height, fmt::format("in [1, {}]", kMaxImageSide));
  }
  if (!(fx > 0.0) || !std::isfinite(fx)) return Bad("fx", fx, "above 0");
  if (!(fy > 0.0) || !std::isfinite(fy)) return Bad("fy", fy, "above 0");
  if (!(cx >= 0.0 && cx < width)) return Bad("cx", cx, fmt::format("in [0, width {})", width));
  if (!(cy >= 0.0 && cy < height)) return Bad("cy", cy, fmt::format("in [0, height {})", height));
  for (const double coefficient : distortion) {
    if (!std::isfinite(coefficient)) return Bad("distortion", coefficient, "finite");
  }
  return {};
}

}  // namespace relocd
