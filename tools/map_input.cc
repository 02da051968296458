#include "map_input.h"

#include <fmt/format.h>

#include "input_check.h"
#include "progress_line.h"

namespace relocd {
namespace {

InputCheck Check(const SelectedFrames& drive, int threads) {
  ProgressLine line(drive.name + ": checking");
  InputCheck check = CheckInput(
      drive.dataset, {.threads = threads, .progress = [&](double done) { line.Show(done, ""); }});
  const auto R_WD = RotationToMap(drive.dataset);
  if (!R_WD && !check.IsRefused()) {
    // The error begins with the folder, as the line that it goes into does.
    const std::string& message = R_WD.error().message;
    check.findings.insert(
        check.findings.begin(),
        {InputSeverity::kRefusal, "world", message.substr(drive.dataset.directory.size() + 2)});
  }
  return check;
}

}  // namespace

Result<InputGate> ParseInputGate(const std::string& word) {
  if (word == "refuse") return InputGate::kRefuse;
  if (word == "warn") return InputGate::kWarn;
  if (word == "off") return InputGate::kOff;
  return Error{ErrorKind::kInvalidInput,
               fmt::format("--input-check is '{}', must be refuse, warn or off", word)};
}

Result<void> CheckDrives(const std::vector<SelectedFrames>& drives, InputGate gate, int threads) {
  if (gate == InputGate::kOff) return {};
  std::string first_refusal;
  for (const SelectedFrames& drive : drives) {
    InputCheck check = Check(drive, threads);
    for (InputFinding& finding : check.findings) {
      const bool is_refusal = finding.severity == InputSeverity::kRefusal;
      if (is_refusal && gate == InputGate::kRefuse && first_refusal.empty()) {
        first_refusal =
            fmt::format("{}: {}: {}", drive.dataset.directory, finding.about, finding.message);
        continue;
      }
      fmt::print(
          stderr, "{}: warning: {}: {}\n", drive.dataset.directory, finding.about, finding.message);
    }
  }
  if (first_refusal.empty()) return {};
  return Error{ErrorKind::kInvalidInput,
               first_refusal + " (--input-check warn makes the map nevertheless)"};
}

bool PrintChecks(const std::vector<SelectedFrames>& drives, int threads) {
  bool is_good = true;
  for (const SelectedFrames& drive : drives) {
    const InputCheck check = Check(drive, threads);
    const bool is_refused = check.IsRefused();
    fmt::print("{}{}: {}\n",
               FormatInputCheck(check, drive.dataset.directory),
               drive.dataset.directory,
               is_refused               ? "refused"
               : check.findings.empty() ? "good"
                                        : "usable");
    is_good = is_good && !is_refused;
  }
  return is_good;
}

}  // namespace relocd
