#pragma once

#include <string>
#include <string_view>
#include <vector>

#include <Eigen/Core>

#include "core/result.h"

namespace relocd {

/// A cross-section of a track, in the frame T of its description: the first one is at the origin
/// and heads along x, z is up.
struct TorcsStation {
  Eigen::Vector2d p_T = Eigen::Vector2d::Zero();  ///< Middle of the track, m.
  double yaw_T_rad = 0.0;                         ///< Direction of driving.
  double left_z_T = 0.0;                          ///< Of the track's left edge, m.
  double right_z_T = 0.0;
  double s_m = 0.0;               ///< Along the middle, from the first station.
  bool is_mesh_boundary = false;  ///< The mesh of the track has vertices at both edges here.
};

/// What a TORCS track's XML file says about the road itself.
struct TorcsLayout {
  std::string mesh_file;  ///< In the track's folder.
  double width_m = 0.0;
  std::vector<TorcsStation> stations;  ///< At most 1 m apart; the last one closes the loop.

  [[nodiscard]] double length_m() const { return stations.back().s_m; }
};

/// Reads the sections `Graphic` and `Main Track` of a track's description: straights, arcs and
/// spirals one after the other, with grade, banking and splines of height. External entities are
/// not followed. A loop that misses its beginning by at most 1 m is closed by spreading the rest
/// over its length.
///
/// @param path  for error messages.
/// @return kInvalidInput naming path and segment where it is damaged, out of range or not closed.
Result<TorcsLayout> ParseTorcsLayout(std::string_view xml, const std::string& path);

}  // namespace relocd
