#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include <Eigen/Core>
#include <fmt/format.h>

#include "support/temporary_folder.h"

namespace relocd {

/// A track made for tests, of which everything is known: 60 m straight along x, a half circle to
/// the left of 25 m radius that climbs 4 m, 60 m back, and a half circle down again. The width is
/// 10 m, and the road begins at (100, 50, 3) in the mesh. Terrain lies 2 m below, a roof 5 m above
/// the first straight, a tree stands in the middle.
class TorcsTestTrack {
 public:
  static constexpr double kStraight = 60.0;
  static constexpr double kRadius = 25.0;
  static constexpr double kWidth = 10.0;
  static constexpr double kClimb = 4.0;
  static constexpr int kSteps = 40;  ///< Of each half circle in the mesh.

  static Eigen::Vector3d p_WT() { return {100.0, 50.0, 3.0}; }
  static double Length() { return 2.0 * (kStraight + std::numbers::pi * kRadius); }

  /// A point of the road in W, `s` metres from its beginning, with its curves as they are.
  static Eigen::Vector3d PointAt(double s, double to_left) {
    const double turn = std::numbers::pi * kRadius;
    s = std::fmod(s, Length());
    const bool is_back = s >= kStraight + turn;
    if (is_back) s -= kStraight + turn;
    const double angle = std::max(0.0, s - kStraight) / kRadius;
    const double along = std::min(s, kStraight);
    const double radius = kRadius - to_left;
    Eigen::Vector3d p(along + radius * std::sin(angle), kRadius - radius * std::cos(angle), 0.0);
    const double t = angle / std::numbers::pi;
    p.z() = kClimb * t * t * (3.0 - 2.0 * t);
    if (is_back) p = {kStraight - p.x(), 2.0 * kRadius - p.y(), kClimb - p.z()};
    return p + p_WT();
  }

  static std::string Layout() {
    const std::string turn = fmt::format(
        "<attstr name=\"type\" val=\"lft\"/><attnum name=\"radius\" unit=\"m\" val=\"{}\"/>"
        "<attnum name=\"arc\" unit=\"deg\" val=\"180\"/><attnum name=\"profil steps\" "
        "val=\"{}\"/>",
        kRadius,
        kSteps);
    const std::string straight = fmt::format(
        "<attstr name=\"type\" val=\"str\"/><attnum name=\"lg\" unit=\"m\" val=\"{}\"/>",
        kStraight);
    const auto ends_at = [](double z) {
      return fmt::format(
          "<attnum name=\"z end\" val=\"{}\"/><attnum name=\"profil end tangent\" unit=\"%\" "
          "val=\"0\"/>",
          z);
    };
    return "<?xml version=\"1.0\"?>\n"
           "<!DOCTYPE params SYSTEM \"params.dtd\" [\n"
           "<!ENTITY default-surfaces SYSTEM \"file:///etc/passwd\">\n]>\n"
           "<params name=\"t\" type=\"param\">\n"
           "<section name=\"Surfaces\">&default-surfaces;</section>\n"
           "<section name=\"Graphic\"><attstr name=\"3d description\" "
           "val=\"test.acc\"/></section>\n"
           "<section name=\"Main Track\">\n"
           "<attnum name=\"width\" val=\"10\"/>\n"
           "<section name=\"Track Segments\">\n"
           "<section name=\"out\">" +
           straight + ends_at(0.0) + "</section>\n<section name=\"up\">" + turn + ends_at(kClimb) +
           "</section>\n<section name=\"back\">" + straight + ends_at(kClimb) +
           "</section>\n<section name=\"down\">" + turn + ends_at(0.0) +
           "</section>\n</section>\n</section>\n</params>\n";
  }

  static std::string Mesh() {
    std::string text =
        "AC3Db\nMATERIAL \"\" rgb 0.4 0.4 0.4 amb 1 1 1 emis 0 0 0 spec 0 0 0 shi 0 trans 0\n"
        "OBJECT world\nkids 9\n";
    text += Road();
    text += Quad("TERR1", "grass.rgb", {40.0, 0.0, 1.0}, {260.0, 0.0, 0.0}, {0.0, 170.0, 0.0});
    text += Quad("ROOF", "grass.rgb", {100.0, 40.0, 8.0}, {30.0, 0.0, 0.0}, {0.0, 20.0, 0.0});
    text += Quad("TREE", "tree1.rgb", {130.0, 75.0, 1.0}, {4.0, 0.0, 0.0}, {0.0, 0.0, 6.0});
    return text;
  }

  /// An SGI image of one pixel, gray and coverage.
  static std::string OnePixel(char gray, char coverage) {
    std::string bytes(512, '\0');
    bytes.replace(0, 12, std::string_view("\x01\xda\0\1\0\3\0\1\0\1\0\2", 12));
    return bytes + gray + coverage;
  }

  /// @return the folder.
  static std::string Write(const TemporaryFolder& root) {
    root.Write("data/textures/grass.rgb", OnePixel('\x40', '\xff'));
    root.Write("tracks/road/test/tree1.rgb", OnePixel('\x50', '\x10'));
    root.Write("tracks/road/test/asphalt.rgb", OnePixel('\x60', '\xff'));
    root.Write("tracks/road/test/test.acc", Mesh());
    root.Write("tracks/road/test/test.xml", Layout());
    return root.path() + "/tracks/road/test";
  }

 private:
  /// AC3D's y is up.
  static std::string Vertex(const Eigen::Vector3d& p_W) {
    return fmt::format("{:.6f} {:.6f} {:.6f}\n", p_W.x(), p_W.z(), -p_W.y());
  }

  /// A strip with a vertex at both edges of each step.
  static std::string Road() {
    std::string vertices;
    std::string corners;
    int count = 0;
    const auto add = [&](double s) {
      vertices += Vertex(PointAt(s, 0.5 * kWidth)) + Vertex(PointAt(s, -0.5 * kWidth));
      corners += fmt::format("{} 0 {} 0 0\n{} 1 {} 0 0\n", count, s / 10.0, count + 1, s / 10.0);
      count += 2;
    };
    const double half = 0.5 * Length();
    for (const double start : {0.0, half}) {
      add(start);
      for (int i = 0; i < kSteps; ++i) {
        add(start + kStraight + (half - kStraight) * i / kSteps);
      }
    }
    add(Length() - 1e-9);
    return fmt::format(
        "OBJECT poly\nname \"TKMN1\"\ntexture \"asphalt.rgb\" base\ntexture \"shadow2.rgb\" "
        "tiled\nnumvert {}\n{}numsurf 1\nSURF 0x14\nmat 0\nrefs {}\n{}kids 0\n",
        count,
        vertices,
        count,
        corners);
  }

  static std::string Quad(const std::string& name,
                          const std::string& texture,
                          const Eigen::Vector3d& corner,
                          const Eigen::Vector3d& u,
                          const Eigen::Vector3d& v) {
    return fmt::format(
        "OBJECT poly\nname \"{}\"\ntexture \"{}\" base\nnumvert 4\n{}{}{}{}numsurf 1\nSURF "
        "0x20\nmat 0\nrefs 4\n0 0 0\n1 1 0\n2 1 1\n3 0 1\nkids 0\n",
        name,
        texture,
        Vertex(corner),
        Vertex(corner + u),
        Vertex(corner + u + v),
        Vertex(corner + v));
  }
};

}  // namespace relocd
