#include "scene_coordinates/map_archive.h"

#include <algorithm>

#include "core/check.h"

namespace relocd {

void MapWriter::Halves(const char* field, const std::vector<float>& values, std::size_t count) {
  RELOCD_CHECK(values.size() == count, field);
  for (const float value : values) {
    constexpr float kLargest = 65504.0F;
    const Eigen::half half(std::clamp(value, -kLargest, kLargest));
    const auto bits = Eigen::numext::bit_cast<std::uint16_t>(half);
    Append(&bits, sizeof(bits));
  }
}

bool MapReader::Take(const char* field, void* out, std::size_t size) {
  if (failed()) return false;
  if (rest_.size() < size) {
    Fail(fmt::format("{} needs {} bytes, {} are left of the content", field, size, rest_.size()));
    return false;
  }
  std::memcpy(out, rest_.data(), size);
  rest_.remove_prefix(size);
  return true;
}

void MapReader::Text(const char* field, std::string& text, std::uint32_t max_size) {
  std::uint32_t size = 0;
  Number<std::uint32_t>(field, size, 0, max_size);
  if (failed()) return;
  if (rest_.size() < size) {
    Fail(fmt::format("{} needs {} bytes, {} are left of the content", field, size, rest_.size()));
    return;
  }
  text.assign(rest_.substr(0, size));
  rest_.remove_prefix(size);
}

void MapReader::Halves(const char* field, std::vector<float>& values, std::size_t count) {
  if (failed()) return;
  if (rest_.size() / sizeof(std::uint16_t) < count) {  // before anything is allocated
    Fail(fmt::format("{} needs {} half-precision values, {} bytes are left of the content",
                     field,
                     count,
                     rest_.size()));
    return;
  }
  values.resize(count);
  for (float& value : values) {
    std::uint16_t bits = 0;
    std::memcpy(&bits, rest_.data(), sizeof(bits));
    rest_.remove_prefix(sizeof(bits));
    value = static_cast<float>(Eigen::numext::bit_cast<Eigen::half>(bits));
    if (!std::isfinite(value)) {
      Fail(fmt::format("{} holds {}, must be finite", field, value));
      return;
    }
  }
  progress_();
}

}  // namespace relocd
