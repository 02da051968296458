#include "report_frames.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include <fmt/format.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "camera/dataset.h"
#include "core/file.h"
#include "geometry/trajectory_metrics.h"

namespace relocd {
namespace {

/// As wide as a phone's screen needs, at most.
Result<std::string> MakeSmall(const std::string& jpeg, const std::string& path) {
  constexpr int kWidth = 480;
  constexpr int kQuality = 82;
  try {
    const std::vector<unsigned char> bytes(jpeg.begin(), jpeg.end());
    cv::Mat image = cv::imdecode(bytes, cv::IMREAD_COLOR);
    if (!image.empty()) {
      const double scale = std::min(1.0, static_cast<double>(kWidth) / image.cols);
      cv::resize(image, image, {}, scale, scale, cv::INTER_AREA);
      std::vector<unsigned char> small;
      cv::imencode(".jpg", image, small, {cv::IMWRITE_JPEG_QUALITY, kQuality});
      return std::string(small.begin(), small.end());
    }
  } catch (const cv::Exception& exception) {
    return Error{ErrorKind::kInvalidInput, fmt::format("{}: {}", path, exception.err)};
  }
  return Error{ErrorKind::kInvalidInput, path + ": is no image that can be decoded"};
}

Result<std::string> ReadSmall(const std::string& path) {
  const auto jpeg = ReadFile(path);
  if (!jpeg) return Error{ErrorKind::kInvalidInput, jpeg.error().message};
  return MakeSmall(*jpeg, path);
}

/// `count` of the indices below `size`, each in the middle of its share.
std::vector<std::size_t> EvenlySpaced(std::size_t size, std::size_t count) {
  const std::size_t chosen = std::min(size, count);
  std::vector<std::size_t> indices;
  for (std::size_t i = 0; i < chosen; ++i)
    indices.push_back((2 * i + 1) * size / (2 * chosen));
  return indices;
}

/// Whether an image was taken while images were worked on.
bool IsDuringDrive(std::int64_t time_ns, const DriveReport& report) {
  return time_ns >= report.camera_rows.front().time_ns &&
         time_ns <= report.camera_rows.back().time_ns;
}

/// The entry that is nearest in time; nothing when it is further than `most_ns` away.
template <typename Entry>
std::optional<std::size_t> Nearest(const std::vector<Entry>& entries,
                                   std::int64_t time_ns,
                                   std::int64_t most_ns) {
  std::optional<std::size_t> nearest;
  std::int64_t least_ns = most_ns;
  for (std::size_t i = 0; i < entries.size(); ++i) {
    const std::int64_t apart_ns = std::abs(entries[i].time_ns - time_ns);
    if (apart_ns > least_ns) continue;
    least_ns = apart_ns;
    nearest = i;
  }
  return nearest;
}

std::optional<double> ErrorAt(const ReportRow& row, std::int64_t time_ns, std::int64_t most_ns) {
  if (!row.evaluation) return std::nullopt;
  const std::vector<PosePair>& pairs = row.evaluation->pairs;
  const auto nearest = Nearest(pairs, time_ns, most_ns);
  if (!nearest) return std::nullopt;
  return PositionErrors(std::span(pairs).subspan(*nearest, 1)).front();
}

/// What the tables say of the image taken at a time.
ReportFrame DescribeFrame(const DriveReport& report, std::int64_t time_ns) {
  constexpr std::int64_t kSameImageNs = 2'000'000;
  constexpr std::int64_t kSameMomentNs = 100'000'000;
  ReportFrame frame;
  frame.time_s = static_cast<double>(time_ns) * 1e-9;
  if (const auto row = Nearest(report.camera_rows, time_ns, kSameImageNs)) {
    frame.camera_status = report.camera_rows[*row].status;
    frame.confidence = report.camera_rows[*row].confidence;
  }
  frame.camera_error_m = ErrorAt(report.camera, time_ns, kSameImageNs);
  frame.fused_error_m = ErrorAt(report.fused, time_ns, kSameMomentNs);
  for (const StatusSpan& span : report.status_spans) {
    if (time_ns >= span.begin_ns && time_ns < span.end_ns) frame.status = span.status;
  }
  return frame;
}

/// Adds the image that the teach drive took nearest to `X_WC`, looking the same way.
Result<void> AddTeachImage(const Dataset& teach, const Pose3& X_WC, ReportFrame& frame) {
  constexpr double kMetresPerRadian = 8.0;  // how far one would rather stand than look elsewhere
  constexpr double kFurthest = 10.0;
  const DatasetFrame* nearest = nullptr;
  double least = kFurthest;
  for (const DatasetFrame& candidate : teach.frames) {
    const double distance_m = (candidate.X_WC.translation() - X_WC.translation()).norm();
    const double angle_rad = candidate.X_WC.rotation().angularDistance(X_WC.rotation());
    const double cost = distance_m + kMetresPerRadian * angle_rad;
    if (cost > least) continue;
    least = cost;
    nearest = &candidate;
    frame.teach_distance_m = distance_m;
  }
  if (nearest == nullptr) return {};
  auto jpeg = ReadSmall(nearest->image_path);
  if (!jpeg) return std::move(jpeg).error();
  frame.teach_jpeg = std::move(jpeg).value();
  return {};
}

Result<std::vector<ReportFrame>> FromDataset(const DriveReport& report,
                                             const FrameSources& sources,
                                             std::size_t count) {
  const auto dataset = ReadDataset(sources.dataset);
  if (!dataset) return Error{ErrorKind::kInvalidInput, dataset.error().message};
  std::optional<Dataset> teach;
  if (!sources.teach_dataset.empty()) {
    auto read = ReadDataset(sources.teach_dataset);
    if (!read) return Error{ErrorKind::kInvalidInput, read.error().message};
    teach = std::move(read).value();
  }
  std::vector<const DatasetFrame*> during;
  for (const DatasetFrame& frame : dataset->frames) {
    if (IsDuringDrive(frame.time_ns, report)) during.push_back(&frame);
  }
  std::vector<ReportFrame> frames;
  for (const std::size_t index : EvenlySpaced(during.size(), count)) {
    const DatasetFrame& source = *during[index];
    ReportFrame frame = DescribeFrame(report, source.time_ns);
    auto jpeg = ReadSmall(source.image_path);
    if (!jpeg) return std::move(jpeg).error();
    frame.jpeg = std::move(jpeg).value();
    if (teach) {
      if (auto ok = AddTeachImage(*teach, source.X_WC, frame); !ok) return std::move(ok).error();
    }
    frames.push_back(std::move(frame));
  }
  return frames;
}

Result<std::vector<ReportFrame>> FromLog(const DriveReport& report,
                                         const FrameSources& sources,
                                         std::size_t count) {
  std::vector<std::int64_t> during_ns;
  for (const std::int64_t time_ns : report.log->image_times_ns) {
    if (IsDuringDrive(time_ns, report)) during_ns.push_back(time_ns);
  }
  std::vector<std::int64_t> chosen_ns;
  for (const std::size_t index : EvenlySpaced(during_ns.size(), count))
    chosen_ns.push_back(during_ns[index]);
  const auto images = ReadLogImages(sources.log, sources.time_origin_ns, chosen_ns);
  if (!images) return images.error();
  std::vector<ReportFrame> frames;
  for (std::size_t i = 0; i < chosen_ns.size(); ++i) {
    auto jpeg = MakeSmall((*images)[i], fmt::format("{}: image {}", sources.log, i));
    if (!jpeg) continue;  // a damaged image of the drive is no reason to have no report
    ReportFrame frame = DescribeFrame(report, chosen_ns[i]);
    frame.jpeg = std::move(jpeg).value();
    frames.push_back(std::move(frame));
  }
  return frames;
}

}  // namespace

Result<std::vector<ReportFrame>> CollectFrames(const DriveReport& report,
                                               const FrameSources& sources,
                                               std::size_t count) {
  if (!sources.dataset.empty()) return FromDataset(report, sources, count);
  if (report.log) return FromLog(report, sources, count);
  return std::vector<ReportFrame>();
}

}  // namespace relocd
