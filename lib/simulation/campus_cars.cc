#include "simulation/campus_cars.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <span>
#include <utility>

#include "rendering/mesh_builder.h"
#include "simulation/campus_pictures.h"

namespace relocd {
namespace {

using Eigen::Vector2f;
using Eigen::Vector3f;

/// A cut through a car's body at one place along it.
struct BodyStation {
  float x = 0.0F;           ///< In parts of the length, from 0.5 at the front to -0.5.
  float belt = 0.9F;        ///< Where the side turns inwards, m above the ground.
  float top = 1.0F;         ///< m above the ground.
  float top_width = 0.8F;   ///< In parts of the width.
  bool side_glass = false;  ///< What follows towards the rear is a side window,
  bool top_glass = false;   ///< or a windscreen.
};

struct CarShape {
  float length = 4.2F;
  float width = 1.78F;
  float wheel_radius = 0.31F;
  float wheel_base = 0.6F;  ///< In parts of the length.
  std::span<const BodyStation> stations;
};

constexpr std::array<BodyStation, 11> kHatchback{{{0.50F, 0.60F, 0.66F, 0.84F, false, false},
                                                  {0.47F, 0.72F, 0.80F, 0.84F, false, false},
                                                  {0.24F, 0.90F, 0.98F, 0.82F, false, true},
                                                  {0.08F, 0.94F, 1.43F, 0.70F, true, false},
                                                  {-0.09F, 0.95F, 1.48F, 0.70F, false, false},
                                                  {-0.115F, 0.95F, 1.48F, 0.70F, true, false},
                                                  {-0.29F, 0.97F, 1.45F, 0.69F, false, false},
                                                  {-0.34F, 0.98F, 1.42F, 0.68F, false, true},
                                                  {-0.46F, 0.97F, 1.02F, 0.80F, false, false},
                                                  {-0.49F, 0.80F, 0.86F, 0.84F, false, false},
                                                  {-0.50F, 0.60F, 0.64F, 0.86F, false, false}}};
constexpr std::array<BodyStation, 12> kSedan{{{0.50F, 0.60F, 0.64F, 0.84F, false, false},
                                              {0.47F, 0.70F, 0.77F, 0.84F, false, false},
                                              {0.20F, 0.88F, 0.95F, 0.82F, false, true},
                                              {0.06F, 0.92F, 1.38F, 0.68F, true, false},
                                              {-0.075F, 0.93F, 1.43F, 0.68F, false, false},
                                              {-0.10F, 0.93F, 1.43F, 0.68F, true, false},
                                              {-0.22F, 0.94F, 1.40F, 0.68F, false, false},
                                              {-0.25F, 0.94F, 1.37F, 0.67F, false, true},
                                              {-0.37F, 0.95F, 1.03F, 0.78F, false, false},
                                              {-0.48F, 0.93F, 1.00F, 0.80F, false, false},
                                              {-0.495F, 0.76F, 0.82F, 0.84F, false, false},
                                              {-0.50F, 0.58F, 0.62F, 0.86F, false, false}}};
constexpr std::array<BodyStation, 12> kEstate{{{0.50F, 0.62F, 0.67F, 0.84F, false, false},
                                               {0.47F, 0.72F, 0.80F, 0.84F, false, false},
                                               {0.21F, 0.90F, 0.97F, 0.82F, false, true},
                                               {0.07F, 0.94F, 1.41F, 0.69F, true, false},
                                               {-0.07F, 0.95F, 1.46F, 0.69F, false, false},
                                               {-0.09F, 0.95F, 1.46F, 0.69F, true, false},
                                               {-0.24F, 0.96F, 1.46F, 0.69F, false, false},
                                               {-0.26F, 0.96F, 1.46F, 0.69F, true, false},
                                               {-0.41F, 0.97F, 1.42F, 0.69F, false, true},
                                               {-0.48F, 0.97F, 1.03F, 0.80F, false, false},
                                               {-0.495F, 0.78F, 0.84F, 0.84F, false, false},
                                               {-0.50F, 0.58F, 0.62F, 0.86F, false, false}}};
constexpr std::array<BodyStation, 11> kSuv{{{0.50F, 0.74F, 0.80F, 0.86F, false, false},
                                            {0.475F, 0.92F, 1.00F, 0.86F, false, false},
                                            {0.23F, 1.06F, 1.13F, 0.84F, false, true},
                                            {0.10F, 1.10F, 1.62F, 0.74F, true, false},
                                            {-0.08F, 1.11F, 1.68F, 0.74F, false, false},
                                            {-0.10F, 1.11F, 1.68F, 0.74F, true, false},
                                            {-0.30F, 1.12F, 1.67F, 0.74F, false, false},
                                            {-0.40F, 1.12F, 1.64F, 0.73F, false, true},
                                            {-0.475F, 1.12F, 1.17F, 0.82F, false, false},
                                            {-0.49F, 0.90F, 0.96F, 0.86F, false, false},
                                            {-0.50F, 0.66F, 0.70F, 0.88F, false, false}}};
constexpr std::array<BodyStation, 10> kVan{{{0.50F, 0.76F, 0.82F, 0.88F, false, false},
                                            {0.48F, 0.96F, 1.06F, 0.88F, false, false},
                                            {0.38F, 1.12F, 1.22F, 0.88F, false, true},
                                            {0.26F, 1.16F, 1.86F, 0.80F, true, false},
                                            {0.12F, 1.18F, 1.98F, 0.82F, false, false},
                                            {0.06F, 1.18F, 2.02F, 0.84F, false, false},
                                            {-0.30F, 1.18F, 2.03F, 0.84F, false, false},
                                            {-0.47F, 1.18F, 2.00F, 0.84F, false, false},
                                            {-0.495F, 1.16F, 1.94F, 0.84F, false, false},
                                            {-0.50F, 0.62F, 0.66F, 0.90F, false, false}}};
constexpr std::array<BodyStation, 6> kLorryCab{{{0.50F, 0.70F, 0.76F, 0.92F, false, false},
                                                {0.495F, 1.20F, 1.30F, 0.92F, false, true},
                                                {0.45F, 1.32F, 2.15F, 0.88F, true, false},
                                                {0.30F, 1.32F, 2.25F, 0.88F, false, false},
                                                {0.245F, 1.32F, 2.25F, 0.88F, false, false},
                                                {0.24F, 0.60F, 0.66F, 0.92F, false, false}}};

class CarBuilder {
 public:
  CarBuilder(const CarShape& shape, const CampusMaterials& materials, std::uint32_t paint)
      : shape_(shape), m_(materials), paint_(paint) {}

  void AddBody() {
    const auto& stations = shape_.stations;
    for (std::size_t i = 0; i + 1 < stations.size(); ++i) {
      const auto front = SectionAt(stations[i]);
      const auto back = SectionAt(stations[i + 1]);
      for (std::size_t k = 0; k + 1 < front.size(); ++k) {
        std::uint32_t material = k == 0 ? m_.dark_plastic : paint_;
        if (k == 3 && stations[i].side_glass) material = m_.car_glass;
        if (k == 4 && stations[i].top_glass) material = m_.car_glass;
        AddBoth({front[k], back[k], back[k + 1], front[k + 1]}, material);
      }
    }
    CloseEnd(SectionAt(stations.front()), true);
    CloseEnd(SectionAt(stations.back()), false);
  }

  void AddWheels() {
    const float axle = 0.5F * shape_.wheel_base * shape_.length;
    for (const float x : {axle, -axle})
      AddWheelPair(x);
  }

  /// Lights, plates, mirrors, doors.
  void AddDetails(std::size_t plate) {
    const float front = 0.5F * shape_.length;
    const float half = 0.5F * shape_.width;
    const float light = shape_.stations[0].belt;
    for (const float side : {-1.0F, 1.0F}) {
      AddBoxAt({front - 0.09F, side * (half - 0.27F), light + 0.005F},
               {0.11F, 0.19F, 0.075F},
               m_.head_light);
      AddBoxAt({-front + 0.03F, side * (half - 0.17F), light + 0.12F},
               {0.06F, 0.11F, 0.10F},
               m_.tail_light);
      AddBoxAt({0.16F * shape_.length, side * (half + 0.09F), shape_.stations[2].belt + 0.08F},
               {0.05F, 0.09F, 0.07F},
               m_.dark_plastic);
      for (const float door : {0.17F, -0.085F, -0.27F}) {
        const float x = door * shape_.length;
        AddBoxAt({x, side * (half - 0.002F), 0.62F}, {0.006F, 0.008F, 0.24F}, m_.dark_plastic);
        AddBoxAt({x - 0.18F, side * (half + 0.002F), 0.80F}, {0.08F, 0.012F, 0.014F}, m_.metal);
      }
    }
    AddBoxAt({front + 0.012F, 0.0F, 0.36F}, {0.02F, half - 0.12F, 0.085F}, m_.dark_plastic);
    AddBoxAt({front + 0.002F, 0.0F, 0.55F}, {0.012F, 0.42F, 0.05F}, m_.dark_plastic);
    AddBoxAt({-front - 0.012F, 0.0F, 0.38F}, {0.02F, half - 0.12F, 0.09F}, m_.dark_plastic);
    AddPlate(front + 0.035F, 1.0F, plate);
    AddPlate(-front - 0.035F, -1.0F, plate);
  }

  /// The box of a lorry or what else is not the body's shape.
  void AddCargoBox(std::uint32_t material) {
    const float half = 0.5F * shape_.width;
    const float rear = -0.5F * shape_.length;
    const float front = 0.225F * shape_.length;
    builder_.AddBox({rear, -half, 0.78F}, {front, half, 2.75F}, material, 2.0F);
    builder_.AddBox(
        {rear, -half + 0.1F, 0.55F}, {front + 0.1F, half - 0.1F, 0.78F}, m_.dark_plastic);
    for (const float side : {-1.0F, 1.0F}) {
      AddBoxAt({0.5F * (rear + front), side * (half + 0.006F), 1.0F},
               {0.5F * (front - rear), 0.006F, 0.025F},
               m_.dark_plastic);
      builder_.AddPicture({side > 0.0F ? front - 0.5F : rear + 0.5F, side * (half + 0.008F), 1.6F},
                          {-side * (front - rear - 1.0F), 0.0F, 0.0F},
                          {0.0F, 0.0F, 0.42F},
                          m_.shop_sign,
                          kShopSigns.Part(3));
    }
  }

  Mesh Take() { return builder_.Take(); }

 private:
  /// Its left half, from the sill to the middle of the top.
  [[nodiscard]] std::array<Vector3f, 6> SectionAt(const BodyStation& station) const {
    const float x = station.x * shape_.length;
    const float half = 0.5F * shape_.width;
    // Corners are drawn in at both ends.
    const float end = std::abs(station.x);
    const float slim = end > 0.485F ? 0.86F : (end > 0.45F ? 0.95F : 1.0F);
    const float sill = 0.24F;
    return {Vector3f(x, 0.9F * slim * half, sill - 0.04F),
            Vector3f(x, 0.96F * slim * half, sill + 0.06F),
            Vector3f(x, slim * half, std::min(0.62F, station.belt - 0.02F)),
            Vector3f(x, 0.965F * slim * half, station.belt),
            Vector3f(x, station.top_width * slim * half, station.top - 0.03F),
            Vector3f(x, 0.0F, station.top)};
  }

  static Vector3f Mirrored(const Vector3f& p) { return {p.x(), -p.y(), p.z()}; }

  /// A four-cornered face of the left side and its mirror image.
  void AddBoth(const std::array<Vector3f, 4>& p, std::uint32_t material) {
    const auto uv = [](const Vector3f& q) -> Vector2f { return {q.x(), q.z() + q.y()}; };
    builder_.AddTriangle({p[0], p[1], p[2]}, {uv(p[0]), uv(p[1]), uv(p[2])}, material);
    builder_.AddTriangle({p[0], p[2], p[3]}, {uv(p[0]), uv(p[2]), uv(p[3])}, material);
    const std::array<Vector3f, 4> q{Mirrored(p[0]), Mirrored(p[1]), Mirrored(p[2]), Mirrored(p[3])};
    builder_.AddTriangle({q[0], q[2], q[1]}, {uv(q[0]), uv(q[2]), uv(q[1])}, material);
    builder_.AddTriangle({q[0], q[3], q[2]}, {uv(q[0]), uv(q[3]), uv(q[2])}, material);
  }

  void CloseEnd(const std::array<Vector3f, 6>& section, bool is_front) {
    for (std::size_t k = 0; k + 1 < section.size(); ++k) {
      const Vector3f a(section[k].x(), 0.0F, section[k].z());
      const Vector3f b(section[k + 1].x(), 0.0F, section[k + 1].z());
      if (is_front) {
        AddBoth({a, section[k], section[k + 1], b}, paint_);
      } else {
        AddBoth({section[k], a, b, section[k + 1]}, paint_);
      }
    }
  }

  void AddBoxAt(const Vector3f& centre, const Vector3f& half, std::uint32_t material) {
    builder_.AddBox(centre - half, centre + half, material);
  }

  void AddPlate(float x, float side, std::size_t plate) {
    builder_.AddPicture({x, -side * 0.26F, 0.42F},
                        {0.0F, side * 0.52F, 0.0F},
                        {0.0F, 0.0F, 0.115F},
                        m_.licence_plates,
                        kLicencePlates.Part(plate));
  }

  /// A disc that faces outwards on one side, without what would reach into the ground.
  void AddDisc(const Vector3f& centre, float radius, float side, std::uint32_t material) {
    constexpr int kSides = 16;
    const auto rim = [&](int i) -> Vector3f {
      const float angle = side * 2.0F * std::numbers::pi_v<float> * static_cast<float>(i) / kSides;
      Vector3f point = centre + radius * Vector3f(-std::cos(angle), 0.0F, std::sin(angle));
      point.z() = std::max(point.z(), 0.0F);
      return point;
    };
    for (int i = 0; i < kSides; ++i)
      builder_.AddTriangle({centre, rim(i), rim(i + 1)},
                           {Vector2f(0.5F, 0.5F), Vector2f(0.0F, 0.0F), Vector2f(1.0F, 0.0F)},
                           material);
  }

  void AddTyre(const Vector3f& centre, float width, float side) {
    constexpr int kSides = 16;
    const float r = shape_.wheel_radius;
    const auto rim = [&](int i, float y) -> Vector3f {
      const float angle = 2.0F * std::numbers::pi_v<float> * static_cast<float>(i) / kSides;
      return centre + Vector3f(r * std::cos(angle), y, r * std::sin(angle));
    };
    for (int i = 0; i < kSides; ++i) {
      const Vector3f corner = rim(i + 1, -0.5F * width);
      builder_.AddQuad(
          corner, rim(i, -0.5F * width) - corner, Vector3f(0.0F, width, 0.0F), m_.rubber);
    }
    AddDisc(centre + Vector3f(0.0F, side * 0.5F * width, 0.0F), r, side, m_.rubber);
    AddDisc(
        centre + Vector3f(0.0F, side * (0.5F * width + 0.006F), 0.0F), 0.66F * r, side, m_.metal);
    for (int spoke = 0; spoke < 5; ++spoke) {
      const float angle = 2.0F * std::numbers::pi_v<float> * static_cast<float>(spoke) / 5.0F;
      const Vector3f hole = centre + Vector3f(0.42F * r * std::cos(angle),
                                              side * (0.5F * width + 0.009F),
                                              0.42F * r * std::sin(angle));
      AddDisc(hole, 0.16F * r, side, m_.rubber);
    }
  }

  void AddWheelPair(float x) {
    const float r = shape_.wheel_radius;
    const float half = 0.5F * shape_.width;
    for (const float side : {-1.0F, 1.0F}) {
      AddDisc({x, side * (half + 0.004F), r + 0.02F}, 1.17F * r, side, m_.rubber);
      AddTyre({x, side * (half - 0.075F), r}, 0.19F, side);
    }
  }

  CarShape shape_;
  const CampusMaterials& m_;
  std::uint32_t paint_;
  MeshBuilder builder_;
};

std::uint32_t AddCarPaint(const Eigen::Array3f& srgb,
                          const CampusMaterials& materials,
                          Scene& scene) {
  const std::uint32_t paint =
      AddTintedMaterial("car paint", materials.plaster_texture, srgb, scene);
  scene.materials[paint].reflectivity = 0.05F;
  return paint;
}

}  // namespace

std::vector<std::uint32_t> AddCarMeshes(const CampusMaterials& materials,
                                        CampusRandom random,
                                        Scene& scene) {
  const std::array<Eigen::Array3f, 8> colours{{{0.86F, 0.87F, 0.88F},
                                               {0.13F, 0.14F, 0.16F},
                                               {0.62F, 0.64F, 0.66F},
                                               {0.48F, 0.13F, 0.13F},
                                               {0.17F, 0.25F, 0.40F},
                                               {0.36F, 0.38F, 0.40F},
                                               {0.30F, 0.38F, 0.33F},
                                               {0.72F, 0.66F, 0.54F}}};
  const std::array<CarShape, 5> shapes{{{3.95F, 1.72F, 0.30F, 0.62F, kHatchback},
                                        {4.65F, 1.80F, 0.32F, 0.60F, kSedan},
                                        {4.55F, 1.80F, 0.32F, 0.60F, kEstate},
                                        {4.40F, 1.86F, 0.36F, 0.60F, kSuv},
                                        {5.10F, 1.96F, 0.34F, 0.60F, kVan}}};
  std::vector<std::uint32_t> meshes;
  std::size_t colour = random.Index(colours.size());
  std::size_t plate = 0;
  for (const CarShape& shape : shapes) {
    for (int variant = 0; variant < 3; ++variant) {
      // Vans are mostly white.
      const bool is_van = shape.length > 5.0F;
      const std::uint32_t paint =
          AddCarPaint(is_van && variant < 2 ? colours[0] : colours.at(colour), materials, scene);
      colour = (colour + 3) % colours.size();
      CarBuilder car(shape, materials, paint);
      car.AddBody();
      car.AddWheels();
      car.AddDetails(plate++);
      meshes.push_back(scene.AddMesh(car.Take()));
    }
  }
  const CarShape lorry{5.9F, 2.05F, 0.39F, 0.58F, kLorryCab};
  for (const std::size_t paint : {3U, 4U}) {
    CarBuilder car(lorry, materials, AddCarPaint(colours.at(paint), materials, scene));
    car.AddBody();
    car.AddWheels();
    car.AddDetails(plate++);
    car.AddCargoBox(materials.white_wood);
    meshes.push_back(scene.AddMesh(car.Take()));
  }
  return meshes;
}

}  // namespace relocd
