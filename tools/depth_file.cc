#include "depth_file.h"

#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include <fmt/format.h>
#include <opencv2/imgcodecs.hpp>

#include "core/file.h"

namespace relocd {
namespace {

std::string KindOf(const cv::Mat& image) {
  return fmt::format("{} channels of {} bits", image.channels(), 8 * image.elemSize1());
}

}  // namespace

Result<MeasuredDepth> ReadDepthFile(const std::string& path, int width, int height) {
  const auto bytes = ReadFile(path);
  if (!bytes) return bytes.error();
  // OpenCV has no view of constant memory; nothing is written to the input.
  const cv::Mat buffer(1, static_cast<int>(bytes->size()), CV_8U, const_cast<char*>(bytes->data()));
  cv::Mat image;
  try {
    if (!bytes->empty()) image = cv::imdecode(buffer, cv::IMREAD_UNCHANGED);
  } catch (const cv::Exception&) {
    image.release();  // above OpenCV's limits of size
  }
  const auto invalid = [&](const std::string& what) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("{}: {}, must be a PNG file of {} x {} pixels with one channel of 16 "
                             "bits, depth in mm",
                             path,
                             what,
                             width,
                             height)};
  };
  if (image.empty()) return invalid("cannot be read as an image");
  if (image.type() != CV_16UC1) return invalid("has " + KindOf(image));
  if (image.cols != width || image.rows != height)
    return invalid(fmt::format("is {} x {} pixels", image.cols, image.rows));
  return MeasuredDepth{.width = width,
                       .height = height,
                       .depth_mm = {image.begin<std::uint16_t>(), image.end<std::uint16_t>()}};
}

Result<void> WriteDepthFile(const std::string& path, const MeasuredDepth& depth) {
  const cv::Mat image(
      depth.height, depth.width, CV_16U, const_cast<std::uint16_t*>(depth.depth_mm.data()));
  std::vector<std::uint8_t> bytes;
  if (!cv::imencode(".png", image, bytes))
    return Error{ErrorKind::kInternal, fmt::format("{}: encoding the depth image failed", path)};
  return WriteFile(path, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

}  // namespace relocd
