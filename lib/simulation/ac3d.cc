#include "simulation/ac3d.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "core/file.h"
#include "core/parse_number.h"

namespace relocd {
namespace {

constexpr std::int64_t kMaxCount = 4'000'000;  ///< Of vertices, surfaces, corners, children.
constexpr int kMaxDepth = 100;
constexpr std::size_t kMaxMaterials = 100'000;
constexpr std::size_t kMaxObjects = 1'000'000;
constexpr float kMaxCoordinate = 1e6F;
constexpr std::size_t kMaxLayers = 4;
constexpr std::string_view kBlanks = " \t\r";
constexpr std::string_view kObjectKeys =
    "name, data, texture, texrep, texoff, subdiv, crease, rot, loc, url, hidden, locked, folded, "
    "numvert, numsurf, kids";

/// A file line by line, and lines word by word, with the errors that both have.
class LineReader {
 public:
  LineReader(std::string_view text, const std::string& path) : rest_(text), path_(path) {}

  /// Goes to the next line that is not blank; false at the end of the file.
  bool NextLine() {
    while (!rest_.empty()) {
      const auto end = std::min(rest_.find('\n'), rest_.size());
      line_ = rest_.substr(0, end);
      rest_.remove_prefix(std::min(end + 1, rest_.size()));
      ++number_;
      if (line_.find_first_not_of(kBlanks) != std::string_view::npos) return true;
    }
    line_ = {};
    return false;
  }

  /// The next word of the line, or what stands between quotes; nothing at the line's end.
  std::optional<std::string_view> NextWord() {
    const auto first = std::min(line_.find_first_not_of(kBlanks), line_.size());
    line_.remove_prefix(first);
    if (line_.empty()) return std::nullopt;
    const bool is_quoted = line_.front() == '"';
    if (is_quoted) line_.remove_prefix(1);
    const auto end =
        std::min(is_quoted ? line_.find('"') : line_.find_first_of(kBlanks), line_.size());
    const std::string_view word = line_.substr(0, end);
    line_.remove_prefix(std::min(end + (is_quoted ? 1U : 0U), line_.size()));
    return word;
  }

  Result<float> NextFloat(std::string_view what) {
    const auto word = NextWord();
    if (!word) return Fail(fmt::format("{} is missing", what));
    float value = 0.0F;
    const auto [end, error] = std::from_chars(word->data(), word->data() + word->size(), value);
    const bool is_whole = error == std::errc() && end == word->data() + word->size();
    if (is_whole && std::abs(value) <= kMaxCoordinate) return value;
    return Fail(fmt::format(
        "{} is '{}', must be a number in [-{}, {}]", what, *word, kMaxCoordinate, kMaxCoordinate));
  }

  Result<std::int64_t> NextCount(std::string_view what, std::int64_t low, std::int64_t high) {
    const auto word = NextWord();
    if (!word) return Fail(fmt::format("{} is missing", what));
    const auto value = ParseInt64(*word);
    if (value && *value >= low && *value <= high) return *value;
    return Fail(fmt::format("{} is {}, must be in [{}, {}]", what, *word, low, high));
  }

  /// Numbers up to the line's end, at most `capacity`.
  Result<std::size_t> RestAsFloats(std::string_view what, float* values, std::size_t capacity) {
    std::size_t count = 0;
    for (; line_.find_first_not_of(kBlanks) != std::string_view::npos; ++count) {
      if (count == capacity)
        return Fail(fmt::format("{} has more than {} numbers", what, capacity));
      const auto value = NextFloat(what);
      if (!value) return value.error();
      values[count] = *value;
    }
    return count;
  }

  /// Takes `count` bytes after the current line, whatever they are.
  Result<void> SkipBytes(std::size_t count) {
    if (count > rest_.size())
      return Fail(fmt::format("data is {}, must be at most {}", count, rest_.size()));
    number_ += static_cast<int>(
        std::count(rest_.begin(), rest_.begin() + static_cast<std::ptrdiff_t>(count), '\n'));
    rest_.remove_prefix(count);
    return {};
  }

  [[nodiscard]] Error Fail(std::string_view problem) const {
    return {ErrorKind::kInvalidInput, fmt::format("{}: line {}: {}", path_, number_, problem)};
  }
  [[nodiscard]] Error EndsBefore(std::string_view what) const {
    return Fail(fmt::format("the file ends, must go on with {}", what));
  }

  [[nodiscard]] bool IsAtEnd() const {
    return rest_.find_first_not_of(" \t\r\n") == std::string_view::npos;
  }
  [[nodiscard]] int number() const { return number_; }
  [[nodiscard]] std::size_t rest_size() const { return rest_.size(); }

 private:
  std::string_view rest_;
  std::string_view line_;
  const std::string& path_;
  int number_ = 0;
};

class Ac3dParser {
 public:
  Ac3dParser(std::string_view text, const std::string& path) : reader_(text, path) {}

  Result<Ac3dModel> Parse() {
    if (!reader_.NextLine()) return reader_.EndsBefore("AC3D and a version");
    const auto magic = reader_.NextWord();
    if (!magic || !magic->starts_with("AC3D"))
      return reader_.Fail(fmt::format("is '{}', must be AC3D and a version", magic.value_or("")));
    while (reader_.NextLine()) {
      const auto key = reader_.NextWord().value_or("");
      if (key == "MATERIAL") {
        if (auto ok = ParseMaterial(); !ok) return ok.error();
      } else if (key == "OBJECT") {
        if (auto ok = ParseObject(-1, 0); !ok) return ok.error();
      } else {
        return reader_.Fail(fmt::format("is '{}', must be MATERIAL or OBJECT", key));
      }
    }
    if (model_.objects.empty()) return reader_.EndsBefore("OBJECT");
    return std::move(model_);
  }

 private:
  Result<void> ParseMaterial();
  Result<void> ParseColour(std::string_view what, Eigen::Array3f& colour);
  Result<void> ParseObject(int parent, int depth);
  Result<bool> ParseObjectLine(std::string_view key, std::size_t object, int depth);
  Result<void> ParseTexture(Ac3dObject& object);
  Result<void> ParsePair(std::string_view what, Eigen::Vector2f& pair);
  Result<void> ParsePlace(std::string_view key, Ac3dObject& object);
  Result<void> ParseVertices(Ac3dObject& object);
  Result<void> ParseSurfaces(Ac3dObject& object);
  Result<void> ParseSurface(Ac3dObject& object);
  Result<void> ParseSurfaceKind(Ac3dSurface& surface);
  Result<void> ParseCorners(const Ac3dObject& object, Ac3dSurface& surface);
  Result<void> ExpectKey(std::string_view expected);

  LineReader reader_;
  Ac3dModel model_;
  bool is_torcs_variant_ = false;  ///< There was something that AC3D itself does not write.
};

Result<void> Ac3dParser::ParseColour(std::string_view what, Eigen::Array3f& colour) {
  for (Eigen::Index i = 0; i < 3; ++i) {
    const auto value = reader_.NextFloat(what);
    if (!value) return value.error();
    colour[i] = std::clamp(*value, 0.0F, 1.0F);
  }
  return {};
}

Result<void> Ac3dParser::ParseMaterial() {
  if (model_.materials.size() == kMaxMaterials)
    return reader_.Fail(fmt::format("more than {} materials", kMaxMaterials));
  Ac3dMaterial material;
  const auto name = reader_.NextWord();
  if (!name) return reader_.Fail("MATERIAL has no name");
  material.name = *name;
  Eigen::Array3f unused;
  bool is_complete = false;
  while (const auto key = reader_.NextWord()) {
    Result<void> ok;
    if (*key == "rgb") {
      ok = ParseColour("rgb", material.colour);
    } else if (*key == "emis") {
      ok = ParseColour("emis", material.emission);
    } else if (*key == "amb" || *key == "spec") {
      ok = ParseColour(*key, unused);
    } else if (*key == "shi" || *key == "trans") {
      const auto value = reader_.NextFloat(*key);
      if (!value) return value.error();
      is_complete = *key == "trans";
      if (is_complete) material.transparency = std::clamp(*value, 0.0F, 1.0F);
    } else {
      return reader_.Fail(
          fmt::format("MATERIAL has '{}', must be rgb, amb, emis, spec, shi or trans", *key));
    }
    if (!ok) return ok;
  }
  if (!is_complete) return reader_.Fail("MATERIAL has no trans at its end");
  model_.materials.push_back(std::move(material));
  return {};
}

// NOLINTNEXTLINE(misc-no-recursion): as deep as kMaxDepth
Result<void> Ac3dParser::ParseObject(int parent, int depth) {
  if (depth > kMaxDepth)
    return reader_.Fail(fmt::format("objects are nested deeper than {}", kMaxDepth));
  if (model_.objects.size() == kMaxObjects)
    return reader_.Fail(fmt::format("more than {} objects", kMaxObjects));
  if (!reader_.NextWord()) return reader_.Fail("OBJECT has no type");
  const std::size_t index = model_.objects.size();
  model_.objects.emplace_back();
  model_.objects[index].line = reader_.number();
  model_.objects[index].parent = parent;
  while (reader_.NextLine()) {
    const auto is_last = ParseObjectLine(reader_.NextWord().value_or(""), index, depth);
    if (!is_last) return is_last.error();
    if (*is_last) return {};
  }
  return reader_.EndsBefore("the object's lines up to kids");
}

/// One line, or several that belong together. @return whether the object ends with it.
// NOLINTNEXTLINE(misc-no-recursion): as deep as kMaxDepth
Result<bool> Ac3dParser::ParseObjectLine(std::string_view key, std::size_t index, int depth) {
  Ac3dObject& object = model_.objects[index];
  Result<void> ok;
  if (key == "kids") {
    const auto count = reader_.NextCount("kids", 0, kMaxCount);
    if (!count) return count.error();
    for (std::int64_t i = 0; i < *count; ++i) {
      // TORCS' tools drop objects, and leave the numbers of children as they were.
      if (is_torcs_variant_ && reader_.IsAtEnd()) return true;
      if (ok = ExpectKey("OBJECT"); !ok) return ok.error();
      if (ok = ParseObject(static_cast<int>(index), depth + 1); !ok) return ok.error();
    }
    return true;
  }
  if (key == "name") {
    object.name = reader_.NextWord().value_or("");
  } else if (key == "data") {
    const auto count = reader_.NextCount("data", 0, kMaxCount);
    if (!count) return count.error();
    ok = reader_.SkipBytes(static_cast<std::size_t>(*count));
  } else if (key == "texture") {
    ok = ParseTexture(object);
  } else if (key == "texrep") {
    ok = ParsePair(key, object.texture_repeat);
  } else if (key == "texoff") {
    ok = ParsePair(key, object.texture_offset);
  } else if (key == "loc" || key == "rot") {
    ok = ParsePlace(key, object);
  } else if (key == "numvert") {
    ok = ParseVertices(object);
  } else if (key == "numsurf") {
    ok = ParseSurfaces(object);
  } else if (key != "crease" && key != "subdiv" && key != "url" && key != "hidden" &&
             key != "locked" && key != "folded") {
    return reader_.Fail(fmt::format("is '{}', must be one of {}", key, kObjectKeys));
  }
  if (!ok) return ok.error();
  return false;
}

/// `texture "file"`, or with the layer's role behind it; the others than `base` lie over it as
/// baked shadows and skid marks do.
Result<void> Ac3dParser::ParseTexture(Ac3dObject& object) {
  const auto file = reader_.NextWord();
  if (!file) return reader_.Fail("texture has no file name");
  const auto role = reader_.NextWord();
  if (role) is_torcs_variant_ = true;
  const bool is_none = file->empty() || *file == "(null)" || *file == "empty_texture_no_mapping";
  if ((!role || *role == "base") && !is_none) object.texture = *file;
  return {};
}

Result<void> Ac3dParser::ParsePair(std::string_view what, Eigen::Vector2f& pair) {
  for (Eigen::Index i = 0; i < 2; ++i) {
    const auto value = reader_.NextFloat(what);
    if (!value) return value.error();
    pair[i] = *value;
  }
  return {};
}

Result<void> Ac3dParser::ParsePlace(std::string_view key, Ac3dObject& object) {
  std::array<float, 9> values{};
  const std::size_t count = key == "loc" ? 3 : 9;
  for (std::size_t i = 0; i < count; ++i) {
    const auto value = reader_.NextFloat(key);
    if (!value) return value.error();
    values.at(i) = *value;
  }
  if (key == "loc") {
    object.X_PO.translation() = Eigen::Vector3f(values[0], values[1], values[2]);
  } else {
    // The file has the images of the three axes, one after the other: the matrix's columns.
    object.X_PO.linear() = Eigen::Map<const Eigen::Matrix3f>(values.data());
  }
  return {};
}

Result<void> Ac3dParser::ParseVertices(Ac3dObject& object) {
  const auto count = reader_.NextCount("numvert", 0, kMaxCount);
  if (!count) return count.error();
  constexpr std::size_t kShortestLine = 6;
  const auto size = static_cast<std::size_t>(*count);
  object.vertices.clear();
  object.normals.clear();
  object.vertices.reserve(std::min(size, reader_.rest_size() / kShortestLine));
  for (std::size_t i = 0; i < size; ++i) {
    if (!reader_.NextLine()) return reader_.EndsBefore(fmt::format("vertex {} of {}", i + 1, size));
    std::array<float, 6> values{};
    const auto numbers = reader_.RestAsFloats("vertex", values.data(), values.size());
    if (!numbers) return numbers.error();
    if (*numbers != 3 && *numbers != 6)
      return reader_.Fail(
          fmt::format("vertex has {} numbers, must have 3, or 6 with its normal", *numbers));
    object.vertices.emplace_back(values[0], values[1], values[2]);
    if (*numbers == 6) object.normals.emplace_back(values[3], values[4], values[5]);
  }
  if (!object.normals.empty() && object.normals.size() != size)
    return reader_.Fail(fmt::format(
        "{} of {} vertices have a normal, must be all or none", object.normals.size(), size));
  return {};
}

Result<void> Ac3dParser::ExpectKey(std::string_view expected) {
  if (!reader_.NextLine()) return reader_.EndsBefore(expected);
  const auto key = reader_.NextWord().value_or("");
  if (key == expected) return {};
  return reader_.Fail(fmt::format("is '{}', must be {}", key, expected));
}

Result<void> Ac3dParser::ParseSurfaces(Ac3dObject& object) {
  const auto count = reader_.NextCount("numsurf", 0, kMaxCount);
  if (!count) return count.error();
  for (std::int64_t i = 0; i < *count; ++i) {
    if (auto ok = ParseSurface(object); !ok) return ok;
  }
  return {};
}

Result<void> Ac3dParser::ParseSurface(Ac3dObject& object) {
  Ac3dSurface surface;
  if (auto ok = ExpectKey("SURF"); !ok) return ok;
  if (auto ok = ParseSurfaceKind(surface); !ok) return ok;
  while (true) {
    if (!reader_.NextLine()) return reader_.EndsBefore("mat or refs");
    const auto key = reader_.NextWord().value_or("");
    if (key == "refs") break;
    if (key != "mat") return reader_.Fail(fmt::format("is '{}', must be mat or refs", key));
    const auto last = static_cast<std::int64_t>(model_.materials.size()) - 1;
    if (last < 0) return reader_.Fail("mat comes before any MATERIAL");
    const auto material = reader_.NextCount("mat", 0, last);
    if (!material) return material.error();
    surface.material = static_cast<std::uint32_t>(*material);
  }
  if (model_.materials.empty()) return reader_.Fail("refs come before any MATERIAL");
  if (auto ok = ParseCorners(object, surface); !ok) return ok;
  object.surfaces.push_back(std::move(surface));
  return {};
}

/// Bits 0 to 3 are the kind, bit 4 says smooth, bit 5 two-sided.
Result<void> Ac3dParser::ParseSurfaceKind(Ac3dSurface& surface) {
  const auto word = reader_.NextWord();
  if (!word) return reader_.Fail("SURF has no flags");
  std::string_view digits = *word;
  const bool is_hex = digits.starts_with("0x") || digits.starts_with("0X");
  if (is_hex) digits.remove_prefix(2);
  unsigned flags = 0;
  const auto [end, error] =
      std::from_chars(digits.data(), digits.data() + digits.size(), flags, is_hex ? 16 : 10);
  if (error != std::errc() || end != digits.data() + digits.size())
    return reader_.Fail(fmt::format("SURF is '{}', must be a number such as 0x30", *word));
  switch (flags & 0xfU) {
    case 0:
      surface.kind = Ac3dSurface::Kind::kPolygon;
      break;
    case 1:
      surface.kind = Ac3dSurface::Kind::kClosedLine;
      break;
    case 2:
      surface.kind = Ac3dSurface::Kind::kLine;
      break;
    case 4:
      surface.kind = Ac3dSurface::Kind::kTriangleStrip;
      break;
    default:
      return reader_.Fail(
          fmt::format("SURF is {}, its last digit must be 0 (polygon), 1 (closed line), 2 (line) "
                      "or 4 (triangle strip)",
                      *word));
  }
  surface.is_smooth = (flags & 0x10U) != 0;
  surface.is_two_sided = (flags & 0x20U) != 0;
  return {};
}

Result<void> Ac3dParser::ParseCorners(const Ac3dObject& object, Ac3dSurface& surface) {
  const auto count = reader_.NextCount("refs", 0, kMaxCount);
  if (!count) return count.error();
  constexpr std::size_t kShortestLine = 2;
  const auto size = static_cast<std::size_t>(*count);
  surface.corners.reserve(std::min(size, reader_.rest_size() / kShortestLine));
  const auto last = static_cast<std::int64_t>(object.vertices.size()) - 1;
  for (std::size_t i = 0; i < size; ++i) {
    if (!reader_.NextLine()) return reader_.EndsBefore(fmt::format("corner {} of {}", i + 1, size));
    if (last < 0) return reader_.Fail("a corner comes before any vertex");
    const auto vertex = reader_.NextCount("vertex", 0, last);
    if (!vertex) return vertex.error();
    std::array<float, 2 * kMaxLayers> uvs{};
    const auto numbers = reader_.RestAsFloats("corner", uvs.data(), uvs.size());
    if (!numbers) return numbers.error();
    if (*numbers == 0 || *numbers % 2 != 0)
      return reader_.Fail(
          fmt::format("corner has {} texture coordinates, must have two for each layer", *numbers));
    surface.corners.push_back(
        {.vertex = static_cast<std::uint32_t>(*vertex), .uv = {uvs[0], uvs[1]}});
  }
  return {};
}

}  // namespace

Eigen::Affine3f Ac3dModel::PlaceOf(std::size_t index) const {
  Eigen::Affine3f X_MO = objects[index].X_PO;
  for (int parent = objects[index].parent; parent >= 0;
       parent = objects[static_cast<std::size_t>(parent)].parent) {
    X_MO = objects[static_cast<std::size_t>(parent)].X_PO * X_MO;
  }
  return X_MO;
}

Result<Ac3dModel> ParseAc3d(std::string_view text, const std::string& path) {
  return Ac3dParser(text, path).Parse();
}

Result<Ac3dModel> ReadAc3d(const std::string& path) {
  const auto text = ReadFile(path);
  if (!text) return text.error();
  return ParseAc3d(*text, path);
}

}  // namespace relocd
