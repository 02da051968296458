#include <errno.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include <fmt/core.h>

#include "core/exit_code.h"
#include "core/nearest_name.h"

// reloc: `reloc <verb> ...` becomes `reloc-<verb> ...`, as git does.

namespace {

struct Verb {
  std::string_view name;
  std::string_view help;
};

/// What is beside this program and not in here is listed too, without a help text.
constexpr auto kVerbs = std::to_array<Verb>({
    {"status", "how the daemons are, and where the robot is"},
    {"doctor", "what this robot lacks, and the command that mends it"},
    {"set-pose", "tell smootherd where the robot is"},
    {"reset", "let smootherd forget the pose, and start anew from the fixes"},
    {"check-config", "whether a robot's config is right"},
    {"map", "train a map from a drive, localize images in it, say what is in it"},
    {"can", "the signals of a recorded CAN bus, as the DBC file has them"},
    {"odometry", "odometry from a CAN log, as odometryd makes it"},
    {"calibrate", "wheels, track, yaw rate and steering from a drive with a reference"},
    {"smooth", "fuse odometry and fixes from files, as smootherd does"},
    {"replay", "a recorded log through the daemons' code, exactly"},
    {"log", "inspect, cut, repair and export recorded logs"},
    {"eval", "compare a trajectory with the truth"},
    {"report", "a drive's errors, coverage and latencies: tables, plots, a page"},
    {"sim", "a drive through a simulated world: images, CAN frames, truth"},
    {"import", "bring a public data set into our layout"},
});

std::filesystem::path ProgramDirectory() {
  std::error_code error;
  const auto path = std::filesystem::read_symlink("/proc/self/exe", error);
  return error ? std::filesystem::path(".") : path.parent_path();
}

/// The verbs whose programs are there.
std::vector<std::string> InstalledVerbs(const std::filesystem::path& directory) {
  constexpr std::string_view kPrefix = "reloc-";
  std::vector<std::string> verbs;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(directory, error)) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with(kPrefix)) verbs.push_back(name.substr(kPrefix.size()));
  }
  std::sort(verbs.begin(), verbs.end());
  return verbs;
}

void PrintHelp(const std::vector<std::string>& verbs) {
  fmt::print(
      "reloc {}: tells a ground vehicle where it is on a map that it learned from one drive\n"
      "\nusage: reloc VERB [OPTION...], reloc VERB --help, reloc help | --version\n\n",
      RELOCD_VERSION);
  const auto print = [](std::string_view name, std::string_view help) {
    fmt::print("  {:<14} {}\n", name, help);
  };
  for (const Verb& verb : kVerbs) {
    const bool is_there = std::find(verbs.begin(), verbs.end(), verb.name) != verbs.end();
    if (is_there) print(verb.name, verb.help);
  }
  for (const std::string& name : verbs) {
    const bool is_known = std::any_of(
        kVerbs.begin(), kVerbs.end(), [&](const Verb& verb) { return verb.name == name; });
    if (!is_known) print(name, "");
  }
}

int RefuseVerb(const std::string& verb, const std::vector<std::string>& verbs) {
  const std::string nearest = relocd::NearestName(verb, verbs);
  const std::string hint = nearest.empty() ? "" : fmt::format("did you mean '{}'? ", nearest);
  fmt::print(
      stderr, "reloc: unknown verb '{}', {}the verbs are listed by: reloc help\n", verb, hint);
  return relocd::kExitUsage;
}

}  // namespace

int main(int argc, char** argv) {
  const auto directory = ProgramDirectory();
  const auto verbs = InstalledVerbs(directory);
  const std::string verb = argc < 2 ? "help" : argv[1];
  if (verb == "--version") {
    fmt::print("reloc {}\n", RELOCD_VERSION);
    return relocd::kExitOk;
  }
  if (verb == "help" || verb == "--help" || verb == "-h") {
    PrintHelp(verbs);
    return relocd::kExitOk;
  }
  if (std::find(verbs.begin(), verbs.end(), verb) == verbs.end()) return RefuseVerb(verb, verbs);

  const std::string program = (directory / ("reloc-" + verb)).string();
  ::execv(program.c_str(), argv + 1);
  fmt::print(stderr, "reloc: starting {}: {}\n", program, std::generic_category().message(errno));
  return relocd::kExitFailure;
}
