#include "camera/v4l2_system.h"

#include <errno.h>
#include <fcntl.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <unistd.h>

namespace relocd {

int KernelV4l2System::Open(const char* path, int flags) {
  return ::open(path, flags);
}

int KernelV4l2System::Close(int fd) {
  return ::close(fd);
}

int KernelV4l2System::Ioctl(int fd, unsigned long request, void* argument) {
  while (true) {
    const int result = ::ioctl(fd, request, argument);
    if (result != -1 || errno != EINTR) return result;
  }
}

void* KernelV4l2System::Map(std::size_t size, int fd, long offset) {
  return ::mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_SHARED, fd, offset);
}

int KernelV4l2System::Unmap(void* address, std::size_t size) {
  return ::munmap(address, size);
}

}  // namespace relocd
