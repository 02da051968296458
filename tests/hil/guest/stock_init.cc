// The first process of the stock guest, in its initramfs, linked statically.
//
// Loads the modules of /modules, puts a tmpfs over this machine's / (which QEMU shares, read-only),
// mounts the share on /hil, where writing does reach it, and becomes /hil/guest/run_stock.

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/mount.h>
#include <sys/reboot.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <string>
#include <vector>

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>

namespace {

[[noreturn]] void Die(const std::string& doing) {
  fprintf(stderr, "guest: %s: %s\n", doing.c_str(), strerror(errno));
  reboot(RB_AUTOBOOT);  // QEMU ends where the machine would start again
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

void LoadModules() {
  DIR* const directory = opendir("/modules");
  if (directory == nullptr) Die("opening /modules");
  std::vector<std::string> names;
  while (const dirent* entry = readdir(directory)) {
    const std::string name = static_cast<const char*>(entry->d_name);
    if (name.ends_with(".ko")) names.push_back(name);
  }
  closedir(directory);
  std::sort(names.begin(), names.end());
  for (const std::string& name : names) {
    const int fd = open(("/modules/" + name).c_str(), O_RDONLY | O_CLOEXEC);
    if (syscall(SYS_finit_module, fd, "", 0) != 0 && errno != EEXIST) Die("loading " + name);
    close(fd);
  }
}

void MakeRoot() {
  const std::string shared = "trans=virtio,version=9p2000.L,msize=512000,cache=";
  MountOrDie({"machine", "/lower", "9p", shared + "loose", MS_RDONLY});
  MountOrDie({"tmpfs", "/upper", "tmpfs", "mode=0755", 0});
  for (const char* folder : {"/upper/files", "/upper/work"})
    mkdir(folder, 0755);
  MountOrDie({"overlay",
              "/root",
              "overlay",
              "lowerdir=/lower,upperdir=/upper/files,workdir=/upper/work,redirect_dir=off,"
              "index=off,metacopy=off,xino=off",
              0});
  MountOrDie({"hil", "/root/hil", "9p", shared + "none", 0});
  MountOrDie({"devtmpfs", "/root/dev", "devtmpfs", "", 0});
  MountOrDie({"proc", "/root/proc", "proc", "", 0});
  MountOrDie({"sysfs", "/root/sys", "sysfs", "", 0});
  if (chdir("/root") != 0 || mount(".", "/", nullptr, MS_MOVE, nullptr) != 0 || chroot(".") != 0 ||
      chdir("/") != 0) {
    Die("changing to the new root");
  }
  MountOrDie({"tmpfs", "/run", "tmpfs", "mode=0755", MS_NOSUID | MS_NODEV});
}

}  // namespace

int main() {
  LoadModules();
  MakeRoot();
  setenv("PATH", "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin", 1);
  setenv("HOME", "/root", 1);
  setenv("LANG", "C.UTF-8", 1);
  execl("/bin/bash", "bash", "/hil/guest/run_stock", nullptr);
  Die("starting /hil/guest/run_stock");
}
