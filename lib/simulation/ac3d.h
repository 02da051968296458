#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "core/result.h"

namespace relocd {

/// How a surface of an AC3D object is drawn, after AC3D's "file format" page.
struct Ac3dMaterial {
  std::string name;
  Eigen::Array3f colour = Eigen::Array3f::Ones();    ///< Diffuse, sRGB in [0, 1].
  Eigen::Array3f emission = Eigen::Array3f::Zero();  ///< sRGB in [0, 1].
  float transparency = 0.0F;                         ///< In [0, 1].
};

/// A corner of a surface.
struct Ac3dCorner {
  std::uint32_t vertex = 0;                      ///< Index into the object's.
  Eigen::Vector2f uv = Eigen::Vector2f::Zero();  ///< v goes up the image.
};

struct Ac3dSurface {
  enum class Kind : std::uint8_t { kPolygon, kClosedLine, kLine, kTriangleStrip };

  Kind kind = Kind::kPolygon;
  bool is_smooth = false;
  bool is_two_sided = false;
  std::uint32_t material = 0;  ///< Index into the model's.
  std::vector<Ac3dCorner> corners;
};

struct Ac3dObject {
  std::string name;
  int line = 0;         ///< Where it starts.
  int parent = -1;      ///< Index into the model's objects; -1: none.
  std::string texture;  ///< File name; empty: none.
  Eigen::Vector2f texture_repeat = Eigen::Vector2f::Ones();
  Eigen::Vector2f texture_offset = Eigen::Vector2f::Zero();
  Eigen::Affine3f X_PO = Eigen::Affine3f::Identity();  ///< From the object to its parent.
  std::vector<Eigen::Vector3f> vertices;               ///< In the object; y up.
  std::vector<Eigen::Vector3f> normals;                ///< Empty, or one for each vertex.
  std::vector<Ac3dSurface> surfaces;
};

/// A model in AC3D's axes: x right, y up, z towards the viewer.
struct Ac3dModel {
  std::vector<Ac3dMaterial> materials;
  std::vector<Ac3dObject> objects;  ///< Each after its parent.

  /// From the object at `index` to the model.
  [[nodiscard]] Eigen::Affine3f PlaceOf(std::size_t index) const;
};

/// Parses the text of an AC3D file (.ac), or of TORCS' variant of it (.acc): vertices may have
/// normals, surfaces may be triangle strips, and textures and corners may come in several layers,
/// of which the first, `base`, is kept, and objects may announce more children than there are at
/// the file's end. Any bytes are safe to pass.
///
/// @param path  for error messages.
/// @return kInvalidInput naming path and line: `path: line 123: numvert is 99999999, must be ...`.
Result<Ac3dModel> ParseAc3d(std::string_view text, const std::string& path);

/// ParseAc3d of a file. @return kUnavailable when it cannot be read.
Result<Ac3dModel> ReadAc3d(const std::string& path);

}  // namespace relocd
