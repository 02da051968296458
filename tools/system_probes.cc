#include "system_probes.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/timex.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <filesystem>
#include <system_error>
#include <utility>

#include <fmt/format.h>
#include <spawn.h>

#include "camera/v4l2_description.h"
#include "camera/v4l2_system.h"
#include "core/file.h"
#include "core/time.h"
#include "core/unique_fd.h"
#include "messaging/lcm_bus.h"
#include "scene_coordinates/map_file.h"

namespace relocd {
namespace {

constexpr Duration kLoopBackTimeout = std::chrono::seconds(1);

std::string ReadToEnd(int fd) {
  std::string text;
  std::array<char, 4096> part{};
  while (true) {
    const ssize_t size = ::read(fd, part.data(), part.size());
    if (size <= 0) return text;
    text.append(part.data(), static_cast<std::size_t>(size));
  }
}

}  // namespace

std::optional<std::string> ThisMachine::Read(const std::string& path) {
  auto text = ReadFile(path);
  if (!text) return std::nullopt;
  return std::move(text).value();
}

bool ThisMachine::Exists(const std::string& path) {
  std::error_code error;
  return std::filesystem::exists(path, error);
}

std::optional<std::string> ThisMachine::Output(const std::vector<std::string>& command) {
  std::array<int, 2> ends{};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0) return std::nullopt;
  const UniqueFd reader(ends[0]);
  UniqueFd writer(ends[1]);

  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_adddup2(&actions, writer.get(), STDOUT_FILENO);
  ::posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
  std::vector<std::string> words = command;
  std::vector<char*> arguments;
  arguments.reserve(words.size() + 1);
  for (std::string& word : words)
    arguments.push_back(word.data());
  arguments.push_back(nullptr);
  pid_t pid = 0;
  const int failed =
      ::posix_spawnp(&pid, arguments.front(), &actions, nullptr, arguments.data(), ::environ);
  ::posix_spawn_file_actions_destroy(&actions);
  if (failed != 0) return std::nullopt;
  writer = UniqueFd();
  std::string text = ReadToEnd(reader.get());
  int status = 0;
  if (::waitpid(pid, &status, 0) != pid || !WIFEXITED(status) || WEXITSTATUS(status) != 0) {
    return std::nullopt;
  }
  return text;
}

std::optional<std::int64_t> ThisMachine::FreeBytes(const std::string& folder) {
  std::filesystem::path path = folder;
  std::error_code error;
  while (!std::filesystem::exists(path, error) && path.has_relative_path())
    path = path.parent_path();
  const auto space = std::filesystem::space(path, error);
  if (error) return std::nullopt;
  return static_cast<std::int64_t>(space.available);
}

Result<void> ThisMachine::LoopBack(const std::string& lcm_url) {
  auto bus = LcmBus::Open(lcm_url);
  if (!bus) return std::move(bus).error();
  const std::string channel = fmt::format("DOCTOR_{}", ::getpid());
  bool is_back = false;
  (*bus)->SubscribeRaw(channel, [&](const auto& /*channel*/, auto /*bytes*/) { is_back = true; });
  if (auto ok = (*bus)->CheckListening(); !ok) return ok;
  const std::array<std::uint8_t, 1> message{};
  if (auto ok = (*bus)->PublishBytes(channel, message); !ok) return ok;
  const MonotonicTime end = MonotonicClock::now() + kLoopBackTimeout;
  while (!is_back && MonotonicClock::now() < end) {
    constexpr int kTurnMs = 50;
    pollfd ready{.fd = (*bus)->fd(), .events = POLLIN, .revents = 0};
    ::poll(&ready, 1, kTurnMs);
    (*bus)->HandlePending();
  }
  if (is_back) return {};
  return Error{ErrorKind::kUnavailable,
               fmt::format("a message did not come back within {} s", ToSeconds(kLoopBackTimeout))};
}

bool ThisMachine::IsClockSynchronized() {
  timex clock{};
  return ::adjtimex(&clock) >= 0 && (clock.status & STA_UNSYNC) == 0;
}

Result<SystemProbes::MapCamera> ThisMachine::ReadMapCamera(const std::string& path) {
  auto map = ReadMap(path);
  if (!map) return std::move(map).error();
  return MapCamera{.width = map->camera.width, .height = map->camera.height};
}

Result<std::string> ThisMachine::DescribeCamera(const CameraConfig& config) {
  KernelV4l2System kernel;
  return relocd::DescribeCamera(kernel, config);
}

}  // namespace relocd
