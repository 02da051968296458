#include "doctor.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <sstream>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "core/parse_number.h"

namespace relocd {
namespace {

constexpr std::int64_t kBytesPerMb = 1'000'000;

Finding Ok(std::string name, std::string found) {
  return {.name = std::move(name), .is_ok = true, .found = std::move(found), .command = {}};
}

Finding Problem(std::string name, std::string found, std::string command) {
  return {.name = std::move(name),
          .is_ok = false,
          .found = std::move(found),
          .command = std::move(command)};
}

std::vector<std::string> Words(const std::string& text) {
  std::istringstream stream(text);
  std::vector<std::string> words;
  for (std::string word; stream >> word;)
    words.push_back(word);
  return words;
}

std::vector<std::string> Lines(const std::string& text) {
  std::istringstream stream(text);
  std::vector<std::string> lines;
  for (std::string line; std::getline(stream, line);)
    lines.push_back(line);
  return lines;
}

/// The parts of `udpm://GROUP:PORT?...key=value...`.
struct LcmAddress {
  std::string group;
  int port = 0;
  std::int64_t receive_buffer_bytes = 0;  ///< 0 when it does not say.
};

LcmAddress ParseLcmUrl(const std::string& url) {
  LcmAddress address;
  constexpr std::string_view kScheme = "udpm://";
  if (!url.starts_with(kScheme)) return address;
  const std::string rest = url.substr(kScheme.size());
  const auto colon = rest.find(':');
  address.group = rest.substr(0, std::min(colon, rest.find('?')));
  if (colon != std::string::npos) {
    const auto end = rest.find('?', colon);
    const auto length = end == std::string::npos ? end : end - colon - 1;
    address.port = static_cast<int>(ParseInt64(rest.substr(colon + 1, length)).value_or(0));
  }
  constexpr std::string_view kBuffer = "recv_buf_size=";
  const auto buffer = rest.find(kBuffer);
  if (buffer != std::string::npos) {
    const std::string value = rest.substr(buffer + kBuffer.size());
    address.receive_buffer_bytes = ParseInt64(value.substr(0, value.find('&'))).value_or(0);
  }
  return address;
}

/// An IPv4 address as /proc/net/route writes it, where the first byte is the lowest.
std::optional<std::uint32_t> KernelAddress(const std::string& dotted) {
  std::uint32_t address = 0;
  std::istringstream stream(dotted);
  std::string part;
  int count = 0;
  for (; std::getline(stream, part, '.') && count < 4; ++count) {
    const auto value = ParseInt64(part);
    if (!value || *value < 0 || *value > 255) return std::nullopt;
    address |= static_cast<std::uint32_t>(*value) << (8 * count);
  }
  if (count != 4) return std::nullopt;
  return address;
}

std::optional<std::uint32_t> Hexadecimal(const std::string& text) {
  std::uint32_t value = 0;
  if (text.empty() || text.size() > 8) return std::nullopt;
  for (const char c : text) {
    const auto digit = std::string_view("0123456789ABCDEF").find(c);
    if (digit == std::string_view::npos) return std::nullopt;
    value = value << 4 | static_cast<std::uint32_t>(digit);
  }
  return value;
}

/// The interface that the kernel's table sends the address to; empty without a route.
std::string RouteInterface(const std::string& table, std::uint32_t address) {
  std::string interface;
  int longest = -1;
  for (const std::string& line : Lines(table)) {
    const auto words = Words(line);
    constexpr std::size_t kDestination = 1;
    constexpr std::size_t kMask = 7;
    if (words.size() <= kMask) continue;
    const auto destination = Hexadecimal(words[kDestination]);
    const auto mask = Hexadecimal(words[kMask]);
    if (!destination || !mask || (address & *mask) != *destination) continue;
    const int length = __builtin_popcount(*mask);
    if (length <= longest) continue;
    longest = length;
    interface = words[0];
  }
  return interface;
}

/// Whether a network interface is up, or nothing when there is none of this name.
std::optional<bool> IsUp(SystemProbes& probes, const std::string& interface) {
  const auto flags = probes.Read("/sys/class/net/" + interface + "/flags");
  if (!flags || Words(*flags).empty()) return std::nullopt;
  const std::string text = Words(*flags).front();
  if (!text.starts_with("0x") || text.size() < 3) return std::nullopt;
  const auto last = std::string_view("0123456789abcdef").find(text.back());
  return last != std::string_view::npos && (last & 1U) != 0;  // IFF_UP
}

/// A service that is not there or has no such property gives nothing.
std::string ServiceProperty(SystemProbes& probes, const std::string& property) {
  const auto text =
      probes.Output({"systemctl", "show", std::string(kServiceUnit), "-p", property, "--value"});
  const auto words = text ? Words(*text) : std::vector<std::string>();
  return words.empty() ? "" : words.front();
}

// --- the checks, each in one function

Finding CheckRoute(const Config& config, SystemProbes& probes) {
  const std::string name = "lcm route";
  const std::string group = ParseLcmUrl(config.bus.control_url).group;
  const auto address = KernelAddress(group);
  if (!address) return Ok(name, config.bus.control_url + " needs none");
  const std::string network = group.substr(0, group.rfind('.')) + ".0/24";
  const std::string command = fmt::format(
      "sudo ip link set lo up && sudo ip route replace {} dev lo src 127.0.0.1", network);
  const std::string interface =
      RouteInterface(probes.Read("/proc/net/route").value_or(""), *address);
  if (interface.empty()) return Problem(name, "there is none to " + group, command);
  if (interface != "lo") {
    return Problem(
        name,
        fmt::format("{} goes to {}, must stay within this machine (lo)", group, interface),
        command);
  }
  if (!IsUp(probes, interface).value_or(false)) {
    return Problem(name, interface + " is down", "sudo ip link set lo up");
  }
  return Ok(name, fmt::format("{} goes to {}", group, interface));
}

Finding CheckLoopBack(const std::string& name, const std::string& url, SystemProbes& probes) {
  const auto came_back = probes.LoopBack(url);
  if (came_back) return Ok(name, url + " carries messages");
  return Problem(name,
                 fmt::format("{}: {}", url, came_back.error().message),
                 "sudo systemctl restart relocd-lcm-route");
}

Finding CheckReceiveBuffer(const Config& config, SystemProbes& probes) {
  const std::string name = "receive buffer";
  const std::int64_t wanted = ParseLcmUrl(config.bus.image_url).receive_buffer_bytes;
  const auto words = Words(probes.Read("/proc/sys/net/core/rmem_max").value_or(""));
  const std::int64_t most = words.empty() ? 0 : ParseInt64(words.front()).value_or(0);
  if (most >= wanted) return Ok(name, fmt::format("net.core.rmem_max is {}", most));
  return Problem(
      name,
      fmt::format(
          "net.core.rmem_max is {}, bus.image_url asks for {}: images will be lost", most, wanted),
      fmt::format("sudo sysctl -w net.core.rmem_max={}", wanted));
}

/// Sockets of other users on an LCM port: theirs would be bound without our asking, and hear what
/// is meant for us.
Finding CheckPort(const std::string& name, const std::string& url, SystemProbes& probes) {
  const int port = ParseLcmUrl(url).port;
  if (port == 0) return Ok(name, url + " needs none");
  const auto ids = probes.Output({"id", "-u", std::string(kServiceUser)});
  const std::string service_id = ids && !Words(*ids).empty() ? Words(*ids).front() : "";
  const std::string suffix = fmt::format(":{:04X}", port);
  int ours = 0;
  for (const std::string& line : Lines(probes.Read("/proc/net/udp").value_or(""))) {
    const auto words = Words(line);
    constexpr std::size_t kLocalAddress = 1;
    constexpr std::size_t kUserId = 7;
    if (words.size() <= kUserId || !words[kLocalAddress].ends_with(suffix)) continue;
    ++ours;
    if (service_id.empty() || words[kUserId] == service_id || words[kUserId] == "0") continue;
    return Problem(
        name,
        fmt::format("a process of user {} listens on UDP port {} too", words[kUserId], port),
        fmt::format("sudo ss -ulpn 'sport = :{}'", port));
  }
  return Ok(name, fmt::format("UDP port {} has {} sockets, none of strangers", port, ours));
}

Finding CheckCan(const Config& config, SystemProbes& probes) {
  const std::string name = "can";
  const std::string& interface = config.can.interface;
  if (config.can.source != "socketcan") return Ok(name, "frames come from a " + config.can.source);
  const auto is_up = IsUp(probes, interface);
  if (!is_up) {
    return Problem(name,
                   fmt::format("there is no interface {}", interface),
                   fmt::format("ip -brief link show type can  # set can.interface to one of these, "
                               "or: sudo ip link add {} type vcan",
                               interface));
  }
  const std::string details =
      probes.Output({"ip", "-details", "link", "show", interface}).value_or("");
  const auto words = Words(details);
  const bool is_virtual = std::ranges::find(words, "vcan") != words.end();
  const std::string type =
      is_virtual ? "" : "type can bitrate 500000 restart-ms 100";  // a controller is set while down
  if (!*is_up) {
    return Problem(
        name,
        interface + " is down",
        fmt::format("sudo ip link set {} up{}{}", interface, type.empty() ? "" : " ", type));
  }
  if (is_virtual) return Ok(name, interface + " is up, a virtual one");
  if (details.find("BUS-OFF") != std::string::npos) {
    return Problem(
        name,
        interface + " is bus-off: the bit rate or the wiring is wrong",
        fmt::format("sudo ip link set {0} down && sudo ip link set {0} up {1}", interface, type));
  }
  const auto restart = std::ranges::find(words, "restart-ms");
  if (restart == words.end() || std::next(restart) == words.end() || *std::next(restart) == "0") {
    // Where an operator was told by systemd-networkd that the adapter cannot: docs/operations.md.
    if (probes.Read(fmt::format("/etc/systemd/network/80-{}.network.d/no-restart.conf", interface)))
      return Ok(name, interface + " is up, restart-ms 0 as no-restart.conf has it");
    // An adapter that refuses is up again all the same, and each keeps its bit rate.
    return Problem(name,
                   interface + " has restart-ms 0: it stays off the bus after a bus-off",
                   fmt::format("sudo ip link set {0} down; sudo ip link set {0} type can "
                               "restart-ms 100; sudo ip link set {0} up",
                               interface));
  }
  return Ok(name, fmt::format("{} is up, restart-ms {}", interface, *std::next(restart)));
}

Finding CheckVideoGroup(SystemProbes& probes) {
  const std::string name = "group video";
  const auto groups = probes.Output({"id", "-nG", std::string(kServiceUser)});
  if (!groups) {
    return Problem(name,
                   fmt::format("there is no user {}", kServiceUser),
                   "sudo systemd-sysusers relocd.conf");
  }
  const auto words = Words(*groups);
  if (std::ranges::find(words, "video") != words.end()) {
    return Ok(name, fmt::format("{} is in it", kServiceUser));
  }
  return Problem(
      name,
      fmt::format("{} is not in it, and may not open cameras", kServiceUser),
      fmt::format("sudo adduser {} video && sudo systemctl restart relocd", kServiceUser));
}

Finding CheckCamera(const std::string& camera, const CameraConfig& config, SystemProbes& probes) {
  const std::string name = "camera " + camera;
  if (config.driver != "v4l2") {
    if (probes.Exists(config.file.dataset)) return Ok(name, "plays " + config.file.dataset);
    return Problem(name, config.file.dataset + " is not there", "ls " + config.file.dataset);
  }
  if (probes.Exists(config.device)) {
    // Who may not open it reads that elsewhere: this line is about the camera.
    const auto offer = probes.DescribeCamera(config);
    return Ok(name, offer ? config.device + ": " + *offer : config.device + " is there");
  }
  return Problem(name,
                 config.device + " is not there",
                 fmt::format("ls -l /dev/v4l/by-id /dev/video*  # plug it in, or set "
                             "cameras.{}.device to one of these",
                             camera));
}

Finding CheckMap(const Config& config, const std::string& config_path, SystemProbes& probes) {
  const std::string name = "map";
  const std::string& path = config.inference.map_path;
  if (!config.supervisor.inferenced.enabled)
    return Ok(name, "supervisor.inferenced is not enabled");
  const std::string made = "reloc map train --dataset DIR --out " + (path.empty() ? "MAP" : path);
  if (path.empty()) {
    return Problem(name, "inference.map_path is empty: there is dead reckoning only", made);
  }
  const auto camera = probes.ReadMapCamera(path);
  if (!camera) {
    return Problem(name, camera.error().message + ": there is dead reckoning only", made);
  }
  for (const auto& [camera_name, settings] : config.cameras) {
    if (settings.driver != "v4l2") continue;
    if (settings.width == camera->width && settings.height == camera->height) continue;
    return Problem(name,
                   fmt::format("is made for {} x {} px, cameras.{} gives {} x {}",
                               camera->width,
                               camera->height,
                               camera_name,
                               settings.width,
                               settings.height),
                   fmt::format("sudoedit {}  # cameras.{}.width: {}, height: {}",
                               config_path,
                               camera_name,
                               camera->width,
                               camera->height));
  }
  return Ok(name, fmt::format("{}, {} x {} px", path, camera->width, camera->height));
}

Finding CheckClock(SystemProbes& probes) {
  if (probes.IsClockSynchronized()) return Ok("clock", "is kept by a time server");
  return Problem("clock",
                 "no time server keeps it: logs of several machines will not fit together",
                 "sudo timedatectl set-ntp true");
}

Finding CheckDisk(const Config& config, SystemProbes& probes) {
  const std::string name = "disk";
  const std::string& folder = config.recorder.directory;
  const auto free_bytes = probes.FreeBytes(folder);
  if (!free_bytes) {
    return Problem(name, folder + " cannot be looked at", "sudo mkdir -p " + folder);
  }
  const std::int64_t free_mb = *free_bytes / kBytesPerMb;
  const std::int64_t needed_mb = config.recorder.min_free_mb + config.recorder.segment_mb;
  if (free_mb >= needed_mb) return Ok(name, fmt::format("{} has {} MB free", folder, free_mb));
  return Problem(
      name,
      fmt::format("{} has {} MB free, needs {} (recorder.min_free_mb and one segment): old "
                  "logs are being deleted",
                  folder,
                  free_mb,
                  needed_mb),
      fmt::format("du -sh {0}/* | sort -h | tail  # delete, or set recorder.max_total_mb "
                  "and min_free_mb",
                  folder));
}

/// The highest SCHED_FIFO priority that a child is to get.
int HighestPriority(const SupervisionConfig& config) {
  int highest = 0;
  for (const ProcessConfig* process : {&config.recorderd,
                                       &config.smootherd,
                                       &config.inferenced,
                                       &config.odometryd,
                                       &config.camerad}) {
    if (process->enabled) highest = std::max(highest, process->priority);
  }
  return highest;
}

Finding CheckRealTime(const Config& config, SystemProbes& probes) {
  const std::string name = "real time";
  const int wanted = HighestPriority(config.supervisor);
  if (wanted == 0) return Ok(name, "is not asked for");
  const std::string limit = ServiceProperty(probes, "LimitRTPRIO");
  const auto value = ParseInt64(limit);
  if (limit == "infinity" || (value && *value >= wanted)) {
    return Ok(name, fmt::format("LimitRTPRIO is {}, priority {} is asked for", limit, wanted));
  }
  return Problem(name,
                 fmt::format("LimitRTPRIO of {} is {}, priority {} is asked for",
                             kServiceUnit,
                             limit.empty() ? "unknown" : limit,
                             wanted),
                 fmt::format("sudo mkdir -p /etc/systemd/system/relocd.service.d && "
                             "printf '[Service]\\nLimitRTPRIO={}\\n' | "
                             "sudo tee /etc/systemd/system/relocd.service.d/real-time.conf && "
                             "sudo systemctl daemon-reload && sudo systemctl restart relocd",
                             wanted));
}

Finding CheckService(const std::string& config_path, SystemProbes& probes) {
  const std::string name = "service";
  const std::string state = ServiceProperty(probes, "ActiveState");
  if (state == "active") return Ok(name, fmt::format("{} is active", kServiceUnit));
  return Problem(
      name,
      fmt::format("{} is {}", kServiceUnit, state.empty() ? "unknown here" : state),
      fmt::format("reloc check-config {} && sudo systemctl restart relocd", config_path));
}

std::string Quoted(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) {
    const auto code = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\') {
      quoted += '\\';
      quoted += c;
    } else if (code < 0x20) {
      quoted += fmt::format("\\u{:04x}", code);
    } else {
      quoted += c;
    }
  }
  return quoted + "\"";
}

}  // namespace

std::vector<Finding> Examine(const Config& config,
                             const std::string& config_path,
                             SystemProbes& probes) {
  std::vector<Finding> findings{
      Ok("config", config_path + " is right"),
      CheckService(config_path, probes),
      CheckRoute(config, probes),
      CheckLoopBack("lcm control", config.bus.control_url, probes),
      CheckLoopBack("lcm images", config.bus.image_url, probes),
      CheckPort("control port", config.bus.control_url, probes),
      CheckPort("image port", config.bus.image_url, probes),
      CheckReceiveBuffer(config, probes),
      CheckCan(config, probes),
      CheckVideoGroup(probes),
  };
  for (const auto& [name, camera] : config.cameras)
    findings.push_back(CheckCamera(name, camera, probes));
  findings.push_back(CheckMap(config, config_path, probes));
  findings.push_back(CheckClock(probes));
  findings.push_back(CheckDisk(config, probes));
  findings.push_back(CheckRealTime(config, probes));
  return findings;
}

bool IsAllOk(const std::vector<Finding>& findings) {
  return std::ranges::all_of(findings, [](const Finding& finding) { return finding.is_ok; });
}

std::string FormatFindings(const std::vector<Finding>& findings) {
  std::string text;
  for (const Finding& finding : findings) {
    text += fmt::format("{:<4} {:<14} {}{}{}\n",
                        finding.is_ok ? "ok" : "FAIL",
                        finding.name,
                        finding.found,
                        finding.is_ok ? "" : ": ",
                        finding.command);
  }
  return text;
}

std::string FormatFindingsAsJson(const std::vector<Finding>& findings) {
  std::vector<std::string> checks;
  checks.reserve(findings.size());
  for (const Finding& finding : findings) {
    checks.push_back(fmt::format(R"({{"name": {}, "ok": {}, "found": {}, "command": {}}})",
                                 Quoted(finding.name),
                                 finding.is_ok,
                                 Quoted(finding.found),
                                 Quoted(finding.command)));
  }
  return fmt::format(
      "{{\"ok\": {}, \"checks\": [{}]}}\n", IsAllOk(findings), fmt::join(checks, ", "));
}

}  // namespace relocd
