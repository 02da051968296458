#pragma once

#include <cstdint>
#include <memory>

#include "rendering/mesh_builder.h"
#include "simulation/test_route.h"
#include "simulation/world.h"

namespace relocd {

/// A flat road along x, 200 m long, with room for cars and people and something to see.
inline World StraightWorld() {
  World world;
  world.name = "straight";
  world.ground = std::make_shared<SlopedGround>(0.0);
  Material gray;
  gray.albedo = Eigen::Array3f::Constant(0.3F);
  const std::uint32_t plain = world.scene.AddMaterial(gray);
  gray.albedo = Eigen::Array3f::Constant(0.7F);
  const std::uint32_t bright = world.scene.AddMaterial(gray);
  MeshBuilder builder;
  builder.AddQuad({-100, -100, 0}, {400, 0, 0}, {0, 200, 0}, plain);
  for (int i = 0; i < 10; ++i) {
    const float x = 20.0F * static_cast<float>(i);
    builder.AddBox({x, 8, 0}, {x + 10, 15, 6}, bright);
  }
  world.scene.instances.push_back({.mesh = world.scene.AddMesh(builder.Take())});
  builder = {};
  builder.AddBox({-2, -0.9F, 0.2F}, {2, 0.9F, 1.5F}, bright);
  world.car_meshes.push_back(world.scene.AddMesh(builder.Take()));
  builder = {};
  builder.AddBox({-0.2F, -0.2F, 0}, {0.2F, 0.2F, 1.8F}, bright);
  world.pedestrian_meshes.push_back(world.scene.AddMesh(builder.Take()));
  for (int i = 0; i <= 200; ++i) {
    world.route.points.emplace_back(i, -1.5);
    if (world.traffic.empty()) world.traffic.emplace_back();
    if (world.walkways.empty()) world.walkways.emplace_back();
    world.traffic[0].points.emplace_back(200 - i, 1.5);
    world.walkways[0].points.emplace_back(i, 5.0);
  }
  for (int i = 0; i < 30; ++i)
    world.parking_spots.emplace_back(6.0 * i, -4.5, 0.0);
  return world;
}

}  // namespace relocd
