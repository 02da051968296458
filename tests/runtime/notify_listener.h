#pragma once

#include <sys/socket.h>
#include <sys/un.h>

#include <array>
#include <cstddef>
#include <string>

#include <gtest/gtest.h>

#include "core/unique_fd.h"

namespace relocd {

/// A manager's side: an abstract datagram socket with a name that the kernel chose.
class NotifyListener {
 public:
  NotifyListener() : fd_(::socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    auto* generic = reinterpret_cast<sockaddr*>(&address);
    EXPECT_EQ(::bind(fd_.get(), generic, sizeof(sa_family_t)), 0);
    socklen_t size = sizeof(address);
    EXPECT_EQ(::getsockname(fd_.get(), generic, &size), 0);
    variable_ = "NOTIFY_SOCKET=@" +
                std::string(&address.sun_path[1], size - offsetof(sockaddr_un, sun_path) - 1);
  }

  [[nodiscard]] const char* variable() const { return variable_.c_str(); }

  std::string Receive() {
    std::array<char, 4096> buffer{};
    const ssize_t size = ::recv(fd_.get(), buffer.data(), buffer.size(), 0);
    return size < 0 ? "nothing" : std::string(buffer.data(), static_cast<std::size_t>(size));
  }

 private:
  UniqueFd fd_;
  std::string variable_;
};

}  // namespace relocd
