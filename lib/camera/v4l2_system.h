#pragma once

#include <cstddef>

namespace relocd {

/// The system calls that the V4L2 driver makes, so that a test can be the kernel. Each behaves as
/// the call of its name: -1 and errno on failure.
class V4l2System {
 public:
  V4l2System() = default;
  virtual ~V4l2System() = default;
  V4l2System(const V4l2System&) = delete;
  V4l2System& operator=(const V4l2System&) = delete;
  V4l2System(V4l2System&&) = delete;
  V4l2System& operator=(V4l2System&&) = delete;

  virtual int Open(const char* path, int flags) = 0;
  virtual int Close(int fd) = 0;
  virtual int Ioctl(int fd, unsigned long request, void* argument) = 0;
  /// Readable, writable and shared. MAP_FAILED on failure.
  virtual void* Map(std::size_t size, int fd, long offset) = 0;
  virtual int Unmap(void* address, std::size_t size) = 0;
};

/// The kernel's.
class KernelV4l2System final : public V4l2System {
 public:
  int Open(const char* path, int flags) override;
  int Close(int fd) override;
  int Ioctl(int fd, unsigned long request, void* argument) override;  ///< Again after a signal.
  void* Map(std::size_t size, int fd, long offset) override;
  int Unmap(void* address, std::size_t size) override;
};

}  // namespace relocd
