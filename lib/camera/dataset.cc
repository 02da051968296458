#include "camera/dataset.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <utility>

#include <fmt/format.h>

#include "core/file.h"
#include "core/parse_number.h"
#include "geometry/trajectory.h"

namespace relocd {
namespace {

constexpr std::string_view kBlanks = " \t";

/// A line that says something, without its comment, and its number counted from 1.
struct TextLine {
  int number = 0;
  std::string_view text;
};

/// A `#` within a word is not a comment: file names have it.
std::string_view WithoutComment(std::string_view line) {
  for (auto hash = line.find('#'); hash != std::string_view::npos;
       hash = line.find('#', hash + 1)) {
    if (hash == 0 || kBlanks.find(line[hash - 1]) != std::string_view::npos) {
      return line.substr(0, hash);
    }
  }
  return line;
}

std::vector<TextLine> ContentLines(std::string_view text) {
  std::vector<TextLine> lines;
  for (int number = 1; !text.empty(); ++number) {
    const auto end = std::min(text.find('\n'), text.size());
    const std::string_view line = Trim(WithoutComment(text.substr(0, end)));
    text.remove_prefix(std::min(end + 1, text.size()));
    if (!line.empty()) lines.push_back({number, line});
  }
  return lines;
}

std::vector<std::string_view> SplitWords(std::string_view line) {
  std::vector<std::string_view> words;
  for (line = Trim(line); !line.empty(); line = Trim(line)) {
    const auto end = std::min(line.find_first_of(kBlanks), line.size());
    words.push_back(line.substr(0, end));
    line.remove_prefix(end);
  }
  return words;
}

Error BadLine(const std::string& path, const TextLine& line, std::string_view allowed) {
  return {ErrorKind::kInvalidInput,
          fmt::format("{}: line {}: is '{}', must be {}", path, line.number, line.text, allowed)};
}

Result<std::vector<double>> ParseNumbers(const std::string& path,
                                         const TextLine& line,
                                         std::string_view allowed) {
  std::vector<double> numbers;
  for (const std::string_view word : SplitWords(line.text)) {
    const auto number = ParseDouble(word);
    if (!number || !std::isfinite(*number)) return BadLine(path, line, allowed);
    numbers.push_back(*number);
  }
  return numbers;
}

bool IsInt(double number) {
  return number == std::floor(number) && std::abs(number) <= std::numeric_limits<int>::max();
}

/// An index that fits an int, or nothing.
std::optional<int> ParseIndex(std::string_view word) {
  const auto index = ParseInt64(word);
  if (!index || *index < 0 || *index > std::numeric_limits<int>::max()) return std::nullopt;
  return static_cast<int>(*index);
}

Error WrongCount(const std::string& directory, std::size_t poses, std::size_t images) {
  return {ErrorKind::kInvalidInput,
          fmt::format("{0}/poses_tum.txt: has {1} poses, must have {2}: one for each image of "
                      "{0}/frames.txt",
                      directory,
                      poses,
                      images)};
}

/// `depth/NAME.png` of the folder, if it is there.
std::string DepthPathOf(const std::string& directory, std::string_view image) {
  std::string path =
      fmt::format("{}/depth/{}.png", directory, std::filesystem::path(image).stem().string());
  std::error_code ignored;
  return std::filesystem::exists(path, ignored) ? path : std::string();
}

}  // namespace

Result<CameraIntrinsics> ParseIntrinsics(std::string_view text, const std::string& path) {
  constexpr std::string_view kForm = "'fx fy cx cy width height [k1 k2 p1 p2 [k3]]'";
  constexpr std::size_t kPinhole = 6;
  constexpr std::size_t kWithFour = 10;
  constexpr std::size_t kWithFive = 11;
  const std::vector<TextLine> lines = ContentLines(text);
  if (lines.size() != 1) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("{}: has {} lines, must have one: {}", path, lines.size(), kForm)};
  }
  auto parsed = ParseNumbers(path, lines.front(), kForm);
  if (!parsed) return std::move(parsed).error();
  const std::vector<double>& numbers = *parsed;
  const bool known_form =
      numbers.size() == kPinhole || numbers.size() == kWithFour || numbers.size() == kWithFive;
  if (!known_form || !IsInt(numbers[4]) || !IsInt(numbers[5])) {
    return BadLine(path, lines.front(), kForm);
  }
  CameraIntrinsics intrinsics{.fx = numbers[0],
                              .fy = numbers[1],
                              .cx = numbers[2],
                              .cy = numbers[3],
                              .width = static_cast<int>(numbers[4]),
                              .height = static_cast<int>(numbers[5]),
                              .distortion = {}};
  std::copy(numbers.begin() + kPinhole, numbers.end(), intrinsics.distortion.begin());
  if (auto valid = intrinsics.Validate(); !valid) {
    return std::move(valid).error().WithContext(
        fmt::format("{}: line {}", path, lines.front().number));
  }
  return intrinsics;
}

Result<std::map<int, SplitPart>> ParseSplit(std::string_view text, const std::string& path) {
  std::map<int, SplitPart> split;
  for (const TextLine& line : ContentLines(text)) {
    const auto words = SplitWords(line.text);
    const auto index = words.size() < 3 ? std::nullopt : ParseIndex(words.front());
    const bool is_train = words.back() == "train";
    if (!index || (!is_train && words.back() != "test")) {
      return BadLine(path, line, "'index file train|test'");
    }
    if (!split.emplace(*index, is_train ? SplitPart::kTrain : SplitPart::kTest).second) {
      return Error{
          ErrorKind::kInvalidInput,
          fmt::format("{}: line {}: index {} came before, must be new", path, line.number, *index)};
    }
  }
  return split;
}

Result<std::map<int, SplitPart>> ReadSplit(const std::string& path) {
  const auto text = ReadFile(path);
  if (!text) return text.error();
  return ParseSplit(*text, path);
}

Result<Dataset> ReadDataset(const std::string& directory) {
  const std::string frames_path = directory + "/frames.txt";
  const std::string poses_path = directory + "/poses_tum.txt";
  const std::string intrinsics_path = directory + "/intrinsics.txt";
  const auto frames_text = ReadFile(frames_path);
  if (!frames_text) return frames_text.error();
  const auto intrinsics_text = ReadFile(intrinsics_path);
  if (!intrinsics_text) return intrinsics_text.error();
  auto intrinsics = ParseIntrinsics(*intrinsics_text, intrinsics_path);
  if (!intrinsics) return std::move(intrinsics).error();
  const auto poses = ReadTumTrajectory(poses_path);
  if (!poses) return poses.error();

  const std::vector<TextLine> images = ContentLines(*frames_text);
  if (images.empty()) {
    return Error{ErrorKind::kInvalidInput,
                 fmt::format("{}: has no images, must have at least one", frames_path)};
  }
  if (poses->size() != images.size()) return WrongCount(directory, poses->size(), images.size());
  Dataset dataset{.directory = directory, .intrinsics = *intrinsics, .frames = {}};
  for (std::size_t i = 0; i < images.size(); ++i) {
    dataset.frames.push_back({.index = static_cast<int>(i),
                              .image_path = fmt::format("{}/{}", directory, images[i].text),
                              .depth_path = DepthPathOf(directory, images[i].text),
                              .time_ns = (*poses)[i].time_ns,
                              .X_WC = (*poses)[i].X_WB});
  }
  return dataset;
}

}  // namespace relocd
