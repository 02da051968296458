#include "recording/segment_writer.h"

#include <algorithm>
#include <ctime>
#include <filesystem>
#include <system_error>
#include <tuple>
#include <utility>
#include <vector>

#include <fmt/chrono.h>
#include <fmt/format.h>

namespace relocd {
namespace {

namespace fs = std::filesystem;

constexpr std::int64_t kBytesPerMb = 1'000'000;
constexpr std::string_view kPrefix = "relocd-";
constexpr std::string_view kSuffix = ".lcmlog";

struct Segment {
  fs::path path;
  std::int64_t size_bytes = 0;
  std::string number{};  ///< `<run>-<number>` of this run's files; empty for those of others.
};

/// recorderd's files in the folder, the oldest first. This run's are the newest whatever their
/// dates say: the clock of a robot without network may begin in the past.
std::vector<Segment> Segments(const std::string& directory, const std::string& run) {
  std::vector<Segment> segments;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(directory, error)) {
    const std::string name = entry.path().filename().string();
    if (!name.starts_with(kPrefix) || !name.ends_with(kSuffix)) continue;
    const auto size = entry.file_size(error);
    if (error) continue;
    const auto number = name.rfind("-" + run + "-");
    segments.push_back({.path = entry.path(),
                        .size_bytes = static_cast<std::int64_t>(size),
                        .number = number == std::string::npos ? "" : name.substr(number)});
  }
  std::sort(segments.begin(), segments.end(), [](const Segment& a, const Segment& b) {
    const auto order = [](const Segment& segment) {  // 10000 is longer, and later, than 9999
      return std::make_tuple(segment.number.size(), segment.number, segment.path);
    };
    return order(a) < order(b);
  });
  return segments;
}

}  // namespace

Result<std::int64_t> SegmentWriter::FreeSpaceOfDisk(const std::string& directory) {
  std::error_code error;
  const fs::space_info space = fs::space(directory, error);
  if (error) {
    return Error{ErrorKind::kUnavailable,
                 fmt::format("reading the free space of {}: {}", directory, error.message())};
  }
  return static_cast<std::int64_t>(space.available);
}

SegmentWriter::SegmentWriter(RecorderConfig config, std::string run, FreeSpace free_space)
    : config_(std::move(config)), run_(std::move(run)), free_space_(std::move(free_space)) {}

Result<void> SegmentWriter::Open() {
  std::error_code error;
  fs::create_directories(config_.directory, error);
  if (error) {
    return Error{ErrorKind::kUnavailable,
                 fmt::format("creating the folder {}: {}", config_.directory, error.message())};
  }
  if (!sync_) sync_.emplace();
  return {};
}

Result<void> SegmentWriter::OpenSegment(std::int64_t timestamp_us) {
  const auto seconds = static_cast<std::time_t>(timestamp_us / 1'000'000);
  const std::string path = fmt::format("{}/{}{:%Y%m%d-%H%M%S}-{}-{:04}{}",
                                       config_.directory,
                                       kPrefix,
                                       fmt::gmtime(seconds),
                                       run_,
                                       segment_number_,
                                       kSuffix);
  auto segment = LogWriter::Create(path);
  if (!segment) return std::move(segment).error();
  segment_.emplace(std::move(segment).value());
  ++segment_number_;
  return {};
}

void SegmentWriter::Append(std::int64_t timestamp_us,
                           std::string_view channel,
                           std::span<const std::uint8_t> data) {
  if (Excluded(channel)) return;
  if (segment_ && segment_->size_bytes() >= config_.segment_mb * kBytesPerMb) {
    Flush();
    segment_.reset();
  }
  if (!segment_) {
    if (auto ok = OpenSegment(timestamp_us); !ok) return Drop(1, ok.error());
  }
  ++unsynced_events_;
  const std::int64_t before = segment_->size_bytes();
  auto ok = segment_->Append(timestamp_us, channel, data);
  if (!ok) return Drop(std::exchange(unsynced_events_, 0), ok.error());
  ++counters_.events;
  counters_.bytes += segment_->size_bytes() - before;
}

void SegmentWriter::Flush() {
  DeleteOldest();
  if (!segment_) return;
  if (auto ok = segment_->Flush(); !ok) {
    Drop(std::exchange(unsynced_events_, 0), ok.error());
    return;
  }
  unsynced_events_ = 0;
  problem_.clear();
  if (!sync_) return;
  if (auto ok = sync_->last_result(); !ok) {
    problem_ = std::move(ok).error().message;
    last_problem_ = problem_;
  }
  if (UniqueFd file = segment_->DuplicateFd(); file.valid()) sync_->Request(std::move(file));
}

Result<void> SegmentWriter::Close() {
  if (!segment_) return {};
  auto ok = segment_->Sync();
  segment_.reset();
  return ok;
}

void SegmentWriter::Drop(std::int64_t events, const Error& error) {
  counters_.dropped += events;
  problem_ = error.message;
  last_problem_ = error.message;
  // What a full disk took of an event is damage that a reader skips. A new file begins once there
  // is room.
  segment_.reset();
  DeleteOldest();
}

void SegmentWriter::DeleteOldest() {
  std::vector<Segment> segments = Segments(config_.directory, run_);
  std::int64_t total = 0;
  for (const Segment& segment : segments)
    total += segment.size_bytes;
  for (const Segment& segment : segments) {
    const bool current = segment_ && segment.path == fs::path(segment_->path());
    const auto free_bytes = free_space_(config_.directory);
    const bool too_full = free_bytes && *free_bytes < config_.min_free_mb * kBytesPerMb;
    if (current || (total <= config_.max_total_mb * kBytesPerMb && !too_full)) return;
    std::error_code error;
    if (!fs::remove(segment.path, error)) return;
    total -= segment.size_bytes;
    ++counters_.segments_deleted;
  }
}

bool SegmentWriter::Excluded(std::string_view channel) const {
  return std::any_of(config_.exclude_channels.begin(),
                     config_.exclude_channels.end(),
                     [channel](const std::string& pattern) {
                       if (!pattern.ends_with('*')) return pattern == channel;
                       const std::string_view prefix(pattern.data(), pattern.size() - 1);
                       return channel.starts_with(prefix);
                     });
}

}  // namespace relocd
