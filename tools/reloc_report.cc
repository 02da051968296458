#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/core.h>
#include <opencv2/imgcodecs.hpp>

#include "core/exit_code.h"
#include "core/file.h"
#include "report_frames.h"
#include "report_html.h"
#include "report_log.h"
#include "report_numbers.h"
#include "report_plot.h"

// reloc report: how a drive went, as a text, a page and a plot.

namespace relocd {
namespace {

struct Options {
  std::string title = "Drive";
  std::string truth;
  std::string odometry;
  std::string camera;
  std::string fused;
  FrameSources sources;
  std::string top_view;
  std::array<double, 4> top_view_extent_m{};
  std::size_t frames = 8;
  std::string out;
  bool json = false;
};

Result<DriveReport> ReadDrive(const Options& options) {
  ReportTables tables;
  auto truth = ReadReportTable(options.truth);
  if (!truth) return std::move(truth).error();
  tables.truth = std::move(truth).value().trajectory;
  for (const auto& [path, table] : {std::pair(&options.odometry, &tables.odometry),
                                    std::pair(&options.camera, &tables.camera),
                                    std::pair(&options.fused, &tables.fused)}) {
    auto read = ReadReportTable(*path);
    if (!read) return std::move(read).error();
    *table = std::move(read).value();
  }
  auto report = MakeDriveReport(tables);
  if (!report) return report;
  report->title = options.title;
  if (options.sources.log.empty()) return report;
  auto log = ReadLogFacts(options.sources.log, options.sources.time_origin_ns);
  if (!log) return Error{ErrorKind::kInvalidInput, log.error().message};
  report->log = std::move(log).value();
  return report;
}

std::string Encoded(const cv::Mat& image, const char* ending) {
  constexpr int kQuality = 90;  // of a JPEG
  std::vector<unsigned char> bytes;
  cv::imencode(ending, image, bytes, {cv::IMWRITE_JPEG_QUALITY, kQuality});
  return {bytes.begin(), bytes.end()};
}

/// Lines and letters as PNG; what lies over a picture of the ground would take megabytes so.
ReportFigure MakeFigure(const cv::Mat& light, const cv::Mat& dark, bool has_picture) {
  const char* const ending = has_picture ? ".jpg" : ".png";
  return {.type = has_picture ? "image/jpeg" : "image/png",
          .light = Encoded(light, ending),
          .dark = Encoded(dark, ending)};
}

/// The figures one below the other.
cv::Mat Stacked(const cv::Mat& top, const cv::Mat& bottom) {
  cv::Mat both;
  cv::vconcat(top, bottom, both);
  return both;
}

Result<void> WriteReport(const Options& options, const DriveReport& report) {
  TopView top_view;
  if (!options.top_view.empty()) {
    auto read = ReadTopView(options.top_view, options.top_view_extent_m);
    if (!read) return std::move(read).error();
    top_view = std::move(read).value();
  }
  const auto frames = CollectFrames(report, options.sources, options.frames);
  if (!frames) return frames.error();
  std::error_code error;
  std::filesystem::create_directories(options.out, error);
  if (error) {
    return Error{ErrorKind::kUnavailable,
                 fmt::format("creating {}: {}", options.out, error.message())};
  }
  const FigureStyle light;
  const FigureStyle dark = FigureStyle::Dark();
  const cv::Mat drive = DrawDrive(report, top_view, light);
  const cv::Mat errors = DrawErrors(report, light);
  const ReportFigure drive_figure =
      MakeFigure(drive, DrawDrive(report, top_view, dark), !top_view.picture.empty());
  const ReportFigure errors_figure = MakeFigure(errors, DrawErrors(report, dark), false);
  const std::array<std::pair<std::string, std::string>, 4> files{{
      {"report.txt", FormatReportText(report)},
      {"report.json", FormatReportJson(report)},
      {"report.html", FormatReportHtml(report, drive_figure, errors_figure, *frames)},
      {"drive.png", Encoded(Stacked(drive, errors), ".png")},
  }};
  for (const auto& [name, content] : files) {
    if (auto ok = WriteFileAtomically(options.out + "/" + name, content); !ok) return ok;
  }
  return {};
}

Result<void> Run(const Options& options) {
  const auto report = ReadDrive(options);
  if (!report) return report.error();
  if (auto ok = WriteReport(options, *report); !ok) return ok;
  fmt::print("{}", options.json ? FormatReportJson(*report) : FormatReportText(*report));
  return {};
}

void AddOptions(CLI::App& app, Options& options) {
  app.add_option("--truth", options.truth, "the body's true poses: time_ns,x_m,y_m,heading_rad")
      ->required();
  app.add_option("--odometry", options.odometry, "ODOMETRY, by reloc log export")->required();
  app.add_option(
         "--camera",
         options.camera,
         "CAMERA_POSE, by reloc log export with --config, so that it gives the body's poses")
      ->required();
  app.add_option("--fused", options.fused, "LOCALIZATION, by reloc log export")->required();
  app.add_option("--log", options.sources.log, "the drive's log: latencies, losses, images");
  app.add_option("--time-origin-ns",
                 options.sources.time_origin_ns,
                 "taken off the log's mono_ns, as for reloc log export");
  auto* const dataset = app.add_option(
      "--dataset", options.sources.dataset, "the drive's data set: the images come from it");
  app.add_option("--teach-dataset",
                 options.sources.teach_dataset,
                 "the teach drive's data set: the same places are shown beside the drive's")
      ->needs(dataset);
  auto* const extent = app.add_option(
      "--top-view-extent", options.top_view_extent_m, "what it shows, m: left,bottom,right,top");
  extent->delimiter(',');
  app.add_option("--top-view", options.top_view, "a picture of the ground, to draw over")
      ->needs(extent);
  app.add_option("--frames", options.frames, "how many images are shown")
      ->capture_default_str()
      ->check(CLI::Range(0, 100));
  app.add_option("--title", options.title, "what the report calls the drive")
      ->capture_default_str();
  app.add_option("--out", options.out, "folder for report.txt, .json, .html and drive.png")
      ->required();
  app.add_flag("--json", options.json, "print report.json, not report.txt");
}

}  // namespace
}  // namespace relocd

int main(int argc, char** argv) {
  CLI::App app("How a drive went: errors, coverage, latencies; a text, a page and a plot.",
               "reloc report");
  relocd::Options options;
  relocd::AddOptions(app, options);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? relocd::kExitOk : relocd::kExitUsage;
  }
  const auto done = relocd::Run(options);
  if (done) return relocd::kExitOk;
  fmt::print(stderr, "reloc report: {}\n", done.error().message);
  return relocd::ExitCode(done.error());
}
