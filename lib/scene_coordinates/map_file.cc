#include "scene_coordinates/map_file.h"

#include <algorithm>
#include <cstring>
#include <limits>
#include <utility>

#include <fmt/format.h>

#include "core/check.h"
#include "core/file.h"
#include "core/sha256.h"
#include "features/gradient_histograms.h"
#include "scene_coordinates/map_archive.h"

namespace relocd {
namespace {

constexpr std::string_view kMagic = "RELOCMAP";
constexpr std::uint32_t kMaxRegions = 1024;
constexpr std::uint32_t kMaxTrainingPoses = 1'000'000;
constexpr std::uint32_t kMaxNameSize = 256;
constexpr std::uint32_t kMaxCellsPerImage = 100'000;
/// Of coordinates: the Earth's circumference, so that nothing overflows later.
constexpr double kMaxMetres = 4e7;
constexpr double kUnbounded = std::numeric_limits<double>::max();

/// What stands before the content.
struct Header {
  std::array<char, 8> magic{};
  std::uint32_t version = 0;
  std::uint32_t reserved = 0;
  std::uint64_t content_size = 0;
  std::array<char, 64> sha256{};  ///< In hexadecimal.
};
static_assert(sizeof(Header) == 88);

/// For messages: what is not printable ASCII as dots.
std::string Printable(std::string_view bytes) {
  std::string text(bytes);
  std::replace_if(
      text.begin(), text.end(), [](char byte) { return byte < ' ' || byte > '~'; }, '.');
  return text;
}

template <typename Archive, typename Camera>
void VisitCamera(Archive& archive, Camera& camera) {
  archive.Number("camera.fx", camera.fx, 1e-3, 1e6);
  archive.Number("camera.fy", camera.fy, 1e-3, 1e6);
  archive.Number("camera.cx", camera.cx, -1e6, 1e6);
  archive.Number("camera.cy", camera.cy, -1e6, 1e6);
  archive.Number("camera.width", camera.width, 1, 8192);
  archive.Number("camera.height", camera.height, 1, 8192);
  for (auto& coefficient : camera.distortion) {
    archive.Number("camera.distortion", coefficient, -1e3, 1e3);
  }
}

template <typename Archive, typename Config>
void VisitFeatures(Archive& archive, Config& features) {
  constexpr int kMax = std::numeric_limits<int>::max();  // Validate knows the ranges
  archive.Number("features.image_width", features.image_width, 0, kMax);
  archive.Number("features.image_height", features.image_height, 0, kMax);
  archive.Number("features.working_width", features.working_width, 0, kMax);
  archive.Number("features.working_height", features.working_height, 0, kMax);
  archive.Number("features.cell_stride", features.cell_stride, 0, kMax);
  archive.Number("features.octaves", features.octaves, 0, kMax);
}

template <typename Archive, typename Whitening>
void VisitWhitening(Archive& archive, Whitening& whitening) {
  archive.Number("whitening.inputs", whitening.inputs, 1, 4096);
  archive.Number("whitening.outputs", whitening.outputs, 1, 4096);
  const auto inputs = static_cast<std::size_t>(whitening.inputs);
  archive.Halves("whitening.mean", whitening.mean, inputs);
  archive.Halves(
      "whitening.basis", whitening.basis, inputs * static_cast<std::size_t>(whitening.outputs));
}

template <typename Archive, typename Summary>
void VisitTraining(Archive& archive, Summary& training) {
  constexpr auto kMax32 = std::numeric_limits<std::uint32_t>::max();
  constexpr auto kMax64 = std::numeric_limits<std::uint64_t>::max();
  archive.Text("training.dataset", training.dataset, kMaxNameSize);
  archive.Text("training.program_version", training.program_version, kMaxNameSize);
  archive.template Number<std::uint64_t>("training.seed", training.seed, 0, kMax64);
  archive.template Number<std::uint32_t>(
      "training.training_frames", training.training_frames, 0, kMax32);
  archive.template Number<std::uint32_t>(
      "training.held_out_frames", training.held_out_frames, 0, kMax32);
  archive.Number("training.median_error_m", training.median_error_m, 0.0, kUnbounded);
  archive.Number("training.p95_error_m", training.p95_error_m, 0.0, kUnbounded);
  archive.Number("training.median_error_rad", training.median_error_rad, 0.0, kUnbounded);
  archive.Number("training.within_1m", training.within_1m, 0.0, 1.0);
}

template <typename Archive, typename HeadType>
void VisitHead(Archive& archive, HeadType& head) {
  archive.Number("head.inputs", head.shape.inputs, 1, 4096);
  archive.Number("head.width", head.shape.width, 16, 2048);
  archive.Number("head.blocks", head.shape.blocks, 0, 16);
  for (int axis = 0; axis < 3; ++axis) {
    archive.Number("head.centre_W", head.centre_W[axis], -kMaxMetres, kMaxMetres);
  }
  archive.Number("head.scale_m", head.scale_m, 1e-6, kMaxMetres);
  for (int index = 0; index < head.shape.layer_count(); ++index) {
    if constexpr (Archive::kReads) {
      if (archive.failed()) return;
      head.layers.emplace_back();
      head.layers.back().inputs = head.shape.LayerInputs(index);
      head.layers.back().outputs = head.shape.LayerOutputs(index);
    }
    auto& layer = head.layers[static_cast<std::size_t>(index)];
    const auto outputs = static_cast<std::size_t>(layer.outputs);
    archive.Halves("head.weights", layer.weights, static_cast<std::size_t>(layer.inputs) * outputs);
    archive.Halves("head.bias", layer.bias, outputs);
  }
}

template <typename Archive, typename Region>
void VisitRegion(Archive& archive, Region& region) {
  archive.Text("region.name", region.name, kMaxNameSize);
  VisitHead(archive, region.head);
  auto& calibration = region.calibration;
  archive.Number("region.covariance_factor", calibration.covariance_factor, 1.0, 1e9);
  archive.Number("region.sigma_floor_m", calibration.sigma_floor_m, 0.0, 1e6);
  archive.Number("region.sigma_floor_rad", calibration.sigma_floor_rad, 0.0, 10.0);
  archive.Number("region.confidence_threshold", calibration.confidence_threshold, 0.0, 1.0);
  auto count = static_cast<std::uint32_t>(region.training_poses.size());
  archive.template Number<std::uint32_t>("region.training_poses", count, 1, kMaxTrainingPoses);
  for (std::uint32_t index = 0; index < count; ++index) {
    if constexpr (Archive::kReads) {
      if (archive.failed()) return;
      region.training_poses.emplace_back();
    }
    auto& pose = region.training_poses[index];
    constexpr auto kMax = static_cast<float>(kMaxMetres);
    for (int axis = 0; axis < 3; ++axis) {
      archive.Number("region.training_pose", pose.p_WC[axis], -kMax, kMax);
    }
    archive.Number("region.training_heading_rad", pose.heading_rad, -10.0F, 10.0F);
  }
}

/// All fields in the order in which they are in the file.
template <typename Archive, typename Map>
void VisitMap(Archive& archive, Map& map) {
  VisitCamera(archive, map.camera);
  for (int index = 0; index < 4; ++index) {
    archive.Number("R_WD", map.R_WD.coeffs()[index], -1.0, 1.0);
  }
  VisitFeatures(archive, map.features);
  archive.template Number<std::uint32_t>(
      "cells_per_image", map.cells_per_image, 4, kMaxCellsPerImage);
  VisitWhitening(archive, map.whitening);
  VisitTraining(archive, map.training);
  auto count = static_cast<std::uint32_t>(map.regions.size());
  archive.template Number<std::uint32_t>("regions", count, 1, kMaxRegions);
  for (std::uint32_t index = 0; index < count; ++index) {
    if constexpr (Archive::kReads) {
      if (archive.failed()) return;
      map.regions.emplace_back();
    }
    VisitRegion(archive, map.regions[index]);
  }
}

Error Refusal(const std::string& name, const std::string& reason) {
  return {ErrorKind::kInvalidInput, fmt::format("{}: {}", name, reason)};
}

/// Whether the parts fit each other; each by itself has been checked.
Result<void> CheckConsistency(const SceneMap& map) {
  if (auto camera = map.camera.Validate(); !camera) return camera;
  if (auto features = Validate(map.features); !features) return features;
  const auto must_be = [](const char* field, auto value, const char* other, auto allowed) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("{} is {}, must be {} as {}", field, value, allowed, other)};
  };
  const GradientHistogramsConfig& features = map.features;
  if (features.image_width != map.camera.width) {
    return must_be("features.image_width", features.image_width, "camera.width", map.camera.width);
  }
  if (features.image_height != map.camera.height) {
    return must_be(
        "features.image_height", features.image_height, "camera.height", map.camera.height);
  }
  const int dimension = GradientHistogramsDimension(features);
  if (map.whitening.inputs != dimension) {
    return must_be("whitening.inputs", map.whitening.inputs, "features.octaves say", dimension);
  }
  for (const MapRegion& region : map.regions) {
    if (region.head.shape.inputs != map.whitening.outputs) {
      return must_be(
          "head.inputs", region.head.shape.inputs, "whitening.outputs", map.whitening.outputs);
    }
  }
  constexpr double kUnitTolerance = 1e-6;
  if (std::abs(map.R_WD.norm() - 1.0) > kUnitTolerance) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("R_WD has norm {}, must be 1", map.R_WD.norm())};
  }
  return {};
}

}  // namespace

float RoundToHalf(float value) {
  constexpr float kLargest = 65504.0F;
  return static_cast<float>(Eigen::half(std::clamp(value, -kLargest, kLargest)));
}

std::string SerializeMap(const SceneMap& map) {
  MapWriter writer;
  VisitMap(writer, map);
  const std::string content = std::move(writer).TakeBytes();
  Header header;
  std::copy(kMagic.begin(), kMagic.end(), header.magic.begin());
  header.version = kMapFormatVersion;
  header.content_size = content.size();
  const std::string digest = Sha256Hex(content);
  std::copy(digest.begin(), digest.end(), header.sha256.begin());
  std::string bytes(sizeof(header), '\0');
  std::memcpy(bytes.data(), &header, sizeof(header));
  return bytes + content;
}

Result<SceneMap> ParseMap(std::string_view bytes,
                          const std::string& name,
                          const Progress& progress) {
  Header header;
  const std::size_t magic_size = std::min(bytes.size(), kMagic.size());
  if (bytes.empty() || bytes.substr(0, magic_size) != kMagic.substr(0, magic_size)) {
    return Refusal(name,
                   fmt::format("begins with '{}', must begin with '{}': it is no map",
                               Printable(bytes.substr(0, magic_size)),
                               kMagic));
  }
  if (bytes.size() < sizeof(header)) {
    return Refusal(name,
                   fmt::format("is {} bytes long, the header alone must be {}: it is truncated",
                               bytes.size(),
                               sizeof(header)));
  }
  std::memcpy(&header, bytes.data(), sizeof(header));
  const std::string_view content = bytes.substr(sizeof(header));
  if (header.version != kMapFormatVersion) {
    return Refusal(name,
                   fmt::format("format version is {}, must be {}: train the map again with "
                               "this program, or use the program that made it",
                               header.version,
                               kMapFormatVersion));
  }
  if (content.size() != header.content_size) {
    return Refusal(name,
                   fmt::format("content is {} bytes long, must be {}: it is {}",
                               content.size(),
                               header.content_size,
                               content.size() < header.content_size ? "truncated" : "too long"));
  }
  const std::string digest = Sha256Hex(content, progress);
  const std::string_view expected(header.sha256.data(), header.sha256.size());
  if (digest != expected) {
    return Refusal(
        name,
        fmt::format(
            "sha256 of the content is {}, must be {}: it is damaged", digest, Printable(expected)));
  }
  SceneMap map;
  MapReader reader(content, progress);
  VisitMap(reader, map);
  if (!reader.failed() && reader.rest_size() != 0) {
    reader.Fail(fmt::format("{} bytes follow the last region, must be 0", reader.rest_size()));
  }
  if (reader.failed()) return Refusal(name, reader.error()->message);
  if (auto consistent = CheckConsistency(map); !consistent) {
    return std::move(consistent).error().WithContext(name);
  }
  map.id = digest;
  return map;
}

Result<SceneMap> ReadMap(const std::string& path, const Progress& progress) {
  const auto bytes = ReadFile(path, progress);
  if (!bytes) {
    return Refusal(path, bytes.error().message + "; a map is made by 'reloc map train'");
  }
  return ParseMap(*bytes, path, progress);
}

Result<void> WriteMap(const SceneMap& map, const std::string& path) {
  return WriteFileAtomically(path, SerializeMap(map));
}

}  // namespace relocd
