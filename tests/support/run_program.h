#pragma once

#include <sys/wait.h>

#include <array>
#include <cstdio>
#include <string>

namespace relocd {

/// How a program ended.
struct Ended {
  int exit_code = -1;
  std::string output;  ///< Of both streams.
};

/// Runs a command line as a person would, through the shell.
inline Ended RunProgram(const std::string& command_line) {
  Ended ended;
  FILE* pipe = ::popen((command_line + " 2>&1").c_str(), "r");
  if (pipe == nullptr) return ended;
  std::array<char, 4096> buffer{};
  while (std::fgets(buffer.data(), buffer.size(), pipe) != nullptr)
    ended.output += buffer.data();
  const int status = ::pclose(pipe);
  if (WIFEXITED(status)) ended.exit_code = WEXITSTATUS(status);
  return ended;
}

}  // namespace relocd
