#include "input_check.h"

#include <algorithm>
#include <iterator>

#include <fmt/format.h>

#include "corner_tracks.h"
#include "input_check_parts.h"

namespace relocd {

bool InputCheck::IsRefused() const {
  return std::any_of(findings.begin(), findings.end(), [](const InputFinding& finding) {
    return finding.severity == InputSeverity::kRefusal;
  });
}

std::string NameFrame(const Dataset& dataset, std::size_t frame) {
  const std::string& path = dataset.frames[frame].image_path;
  const std::string folder = dataset.directory + "/";
  return path.starts_with(folder) ? path.substr(folder.size()) : path;
}

std::string NameFrames(const Dataset& dataset, const std::vector<std::size_t>& frames) {
  constexpr std::size_t kMaxRuns = 4;
  std::string text;
  std::size_t named = 0;
  for (std::size_t runs = 0; named < frames.size() && runs < kMaxRuns; ++runs) {
    const std::size_t first = named;
    while (named + 1 < frames.size() && frames[named + 1] == frames[named] + 1)
      ++named;
    text += fmt::format("{}{}", runs == 0 ? "" : ", ", NameFrame(dataset, frames[first]));
    if (named > first) {
      text += fmt::format(
          "{}{}", named == first + 1 ? ", " : " to ", NameFrame(dataset, frames[named]));
    }
    ++named;
  }
  if (named < frames.size()) text += fmt::format(" and {} more", frames.size() - named);
  return text;
}

double MedianOf(std::vector<double> values) {
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + std::ssize(values) / 2;
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

InputCheck CheckInput(const Dataset& dataset, const InputCheckOptions& options) {
  InputCheck check;
  InputFindings findings;
  CheckRoute(dataset, check.summary, findings);
  if (CheckImageFiles(dataset, findings) && dataset.frames.size() > 1) {
    const auto drive = TrackCorners(dataset, {.threads = options.threads}, options.progress);
    if (drive) {
      CheckImageQuality(dataset, *drive, check.summary, findings);
      CheckPoses(dataset, *drive, check.summary, findings);
    } else {
      findings.Refuse("images", drive.error().message);
    }
  }
  std::stable_sort(findings.list.begin(), findings.list.end(), [](const auto& a, const auto& b) {
    return a.severity > b.severity;
  });
  check.findings = std::move(findings.list);
  return check;
}

std::string FormatInputCheck(const InputCheck& check, const std::string& name) {
  const InputSummary& summary = check.summary;
  std::string text = fmt::format("{}: {} frames, {:.1f} m in {:.1f} s, an image every {:.2f} m\n",
                                 name,
                                 summary.frames,
                                 summary.route_m,
                                 summary.duration_s,
                                 summary.median_step_m);
  auto out = std::back_inserter(text);
  if (summary.images_looked_at > 0) {
    fmt::format_to(out,
                   "{}: {} images looked at: blur {:.1f} px, {:.0f} corners an image\n",
                   name,
                   summary.images_looked_at,
                   summary.blur_px,
                   summary.corners);
  }
  if (summary.segments > 0) {
    fmt::format_to(out,
                   "{}: {:.1f} % of {} corner tracks fit the poses within {:.1f} px, parallax "
                   "{:.1f} deg, corners {:.1f} m away",
                   name,
                   100.0 * summary.fitting_share,
                   summary.segments,
                   summary.tolerance_px,
                   summary.parallax_deg,
                   summary.depth_m);
    if (summary.camera_height_m) {
      fmt::format_to(out, ", ground {:.1f} m below the camera", *summary.camera_height_m);
    }
    if (summary.depth_factor) {
      fmt::format_to(out, ", {:.2f} times as far in the depth images", *summary.depth_factor);
    }
    text += summary.focal_factor
                ? fmt::format(", focal length fits best at {:.2f} times\n", *summary.focal_factor)
                : std::string(", too few turns to check the focal length\n");
  }
  for (const InputFinding& finding : check.findings) {
    fmt::format_to(out,
                   "{}: {}: {}: {}\n",
                   name,
                   finding.severity == InputSeverity::kRefusal ? "refused" : "warning",
                   finding.about,
                   finding.message);
  }
  return text;
}

}  // namespace relocd
