#include <cmath>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <string>

#include <CLI/CLI.hpp>
#include <fmt/core.h>

#include "core/exit_code.h"
#include "evaluation.h"
#include "evaluation_input.h"
#include "evaluation_plot.h"

// reloc eval: how an estimated trajectory compares with the true one.

namespace relocd {
namespace {

struct Options {
  std::string truth;
  std::string estimate;
  std::string rows;
  std::string plot;
  double max_gap_s = 1.0;
  bool align = false;
  bool json = false;
};

Result<void> Run(const Options& options) {
  const auto truth = ReadEvaluatedTrajectory(options.truth);
  if (!truth) return truth.error();
  const auto estimate = ReadEvaluatedTrajectory(options.estimate, options.rows);
  if (!estimate) return estimate.error();
  const auto evaluation =
      Evaluate(*truth,
               *estimate,
               {.align = options.align, .max_gap_ns = std::llround(options.max_gap_s * 1e9)});
  if (!evaluation) return evaluation.error();
  fmt::print("{}",
             options.json ? FormatJson(*evaluation, *truth, *estimate)
                          : FormatTable(*evaluation, *truth, *estimate));
  if (options.plot.empty()) return {};
  const std::string title = fmt::format("{} against {}",
                                        std::filesystem::path(options.estimate).filename().string(),
                                        std::filesystem::path(options.truth).filename().string());
  return WritePlot(*evaluation, title, options.plot);
}

}  // namespace
}  // namespace relocd

int main(int argc, char** argv) {
  CLI::App app("How an estimated trajectory compares with the true one.", "reloc eval");
  relocd::Options options;
  app.add_option("--truth", options.truth, "TUM, planar CSV (planar_truth.csv) or poses.csv")
      ->required();
  app.add_option("--estimate", options.estimate, "the same, or est.csv, fixes.csv")->required();
  app.add_option("--rows", options.rows, "A:B, from row A of the estimate to before row B");
  app.add_option("--max-gap-s", options.max_gap_s, "the truth is not interpolated over longer gaps")
      ->capture_default_str()
      ->check(CLI::Range(1e-3, 1e6));
  app.add_flag("--align", options.align, "also after the rigid transform that fits best");
  app.add_flag("--json", options.json, "for scripts");
  app.add_option("--plot", options.plot, "draw both as a PNG");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? relocd::kExitOk : relocd::kExitUsage;
  }
  const auto done = relocd::Run(options);
  if (done) return relocd::kExitOk;
  fmt::print(stderr, "reloc eval: {}\n", done.error().message);
  return relocd::ExitCode(done.error());
}
