// LD_PRELOAD for User-mode Linux 6.1 on CPUs with AMX.
//
// It keeps 2696 bytes of a process's extended registers, such a CPU has 11008, and
// PTRACE_SETREGSET takes nothing less than all of them: EFAULT, and the guest's kernel panics. What
// is above 2696 bytes nothing in the guest can use, so zeros are written there. Elsewhere this
// does nothing.

#include <errno.h>
#include <sys/ptrace.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

#include <algorithm>
#include <array>

#include <elf.h>
#include <stdarg.h>

namespace {

alignas(64) std::array<char, 32768> registers{};
std::size_t whole_size = 0;  // of this CPU's extended registers, once it is known
std::size_t written = 0;     // to `registers`; behind it are zeros

long SetRegisters(int pid, long kind, const iovec& given) {
  if (whole_size == 0) {
    iovec whole{registers.data(), registers.size()};
    if (syscall(SYS_ptrace, PTRACE_GETREGSET, pid, kind, &whole) == 0) whole_size = whole.iov_len;
    registers.fill(0);
  }
  if (given.iov_len >= whole_size) return syscall(SYS_ptrace, PTRACE_SETREGSET, pid, kind, &given);
  if (given.iov_len < written)
    std::fill(registers.begin() + given.iov_len, registers.begin() + written, 0);
  written = given.iov_len;
  const char* const bytes = static_cast<const char*>(given.iov_base);
  std::copy(bytes, bytes + given.iov_len, registers.begin());
  iovec whole{registers.data(), whole_size};
  return syscall(SYS_ptrace, PTRACE_SETREGSET, pid, kind, &whole);
}

}  // namespace

extern "C" long ptrace(enum __ptrace_request request, ...) {
  va_list arguments;
  va_start(arguments, request);
  const int pid = va_arg(arguments, int);
  void* const address = va_arg(arguments, void*);
  void* const data = va_arg(arguments, void*);
  va_end(arguments);
  const long kind = reinterpret_cast<long>(address);
  if (request == PTRACE_SETREGSET && kind == NT_X86_XSTATE) {
    return SetRegisters(pid, kind, *static_cast<const iovec*>(data));
  }
  if (request != PTRACE_PEEKTEXT && request != PTRACE_PEEKDATA && request != PTRACE_PEEKUSER) {
    return syscall(SYS_ptrace, request, pid, address, data);
  }
  // The C library's ptrace returns what the system call writes.
  long word = 0;
  const long result = syscall(SYS_ptrace, request, pid, address, &word);
  if (result < 0) return result;
  errno = 0;
  return word;
}
