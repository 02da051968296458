// The first process of the guest, started from this machine's / (read-only), linked statically.
//
// Loads the modules of hil.modules=DIR, puts a tmpfs over / so that everything can be written there
// and nothing reaches this machine, mounts hil.share=DIR on /hil, where writing does reach it, and
// becomes systemd.

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/mount.h>
#include <sys/reboot.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <fstream>
#include <string>

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>

namespace {

[[noreturn]] void Die(const std::string& doing) {
  fprintf(stderr, "guest: %s: %s\n", doing.c_str(), strerror(errno));
  sync();
  reboot(RB_POWER_OFF);
  while (true)
    pause();
}

struct Mount {
  std::string source;
  std::string target;
  std::string type;
  std::string options;
  unsigned long flags = 0;
};

void MountOrDie(const Mount& what) {
  mkdir(what.target.c_str(), 0755);
  if (mount(what.source.c_str(),
            what.target.c_str(),
            what.type.c_str(),
            what.flags,
            what.options.c_str()) != 0) {
    Die("mounting " + what.type + " on " + what.target);
  }
}

/// The value of a kernel argument `name=value`; empty without it.
std::string KernelArgument(const std::string& command_line, const std::string& name) {
  const auto begin = command_line.find(name + "=");
  if (begin == std::string::npos) return "";
  const auto value = begin + name.size() + 1;
  return command_line.substr(value, command_line.find_first_of(" \n", value) - value);
}

std::string ReadCommandLine() {
  MountOrDie({"proc", "/proc", "proc", "", 0});
  std::ifstream file("/proc/cmdline");
  std::string line;
  std::getline(file, line);
  umount("/proc");
  return line;
}

void LoadModules(const std::string& folder) {
  DIR* const directory = opendir(folder.c_str());
  if (directory == nullptr) Die("opening " + folder);
  while (const dirent* entry = readdir(directory)) {
    const std::string name = static_cast<const char*>(entry->d_name);
    if (!name.ends_with(".ko")) continue;
    const int fd = open((folder + "/" + name).c_str(), O_RDONLY | O_CLOEXEC);
    if (syscall(SYS_finit_module, fd, "", 0) != 0 && errno != EEXIST) Die("loading " + name);
    close(fd);
  }
  closedir(directory);
}

void MakeRoot(const std::string& share) {
  MountOrDie({"tmpfs", "/mnt", "tmpfs", "mode=0755", 0});
  for (const char* folder : {"/mnt/upper", "/mnt/work", "/mnt/root"})
    mkdir(folder, 0755);
  MountOrDie({"overlay",
              "/mnt/root",
              "overlay",
              "lowerdir=/,upperdir=/mnt/upper,workdir=/mnt/work,redirect_dir=off,index=off,"
              "metacopy=off,xino=off",
              0});
  MountOrDie({"none", "/mnt/root/hil", "hostfs", share, 0});
  MountOrDie({"devtmpfs", "/mnt/root/dev", "devtmpfs", "", 0});
  MountOrDie({"proc", "/mnt/root/proc", "proc", "", 0});
  MountOrDie({"sysfs", "/mnt/root/sys", "sysfs", "", 0});
  if (chdir("/mnt/root") != 0 || mount(".", "/", nullptr, MS_MOVE, nullptr) != 0 ||
      chroot(".") != 0 || chdir("/") != 0) {
    Die("changing to the new root");
  }
  MountOrDie({"tmpfs", "/run", "tmpfs", "mode=0755", MS_NOSUID | MS_NODEV});
  MountOrDie({"tmpfs", "/dev/shm", "tmpfs", "mode=1777", MS_NOSUID | MS_NODEV});
  MountOrDie(
      {"devpts", "/dev/pts", "devpts", "mode=620,gid=5,ptmxmode=666", MS_NOSUID | MS_NOEXEC});
}

}  // namespace

int main() {
  const std::string command_line = ReadCommandLine();
  LoadModules(KernelArgument(command_line, "hil.modules"));
  MakeRoot(KernelArgument(command_line, "hil.share"));
  setenv("PATH", "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin", 1);
  setenv("HOME", "/root", 1);
  setenv("LANG", "C.UTF-8", 1);
  execl("/bin/bash", "bash", "/hil/guest/become_systemd", nullptr);
  Die("starting /hil/guest/become_systemd");
}
