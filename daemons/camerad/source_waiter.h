#pragma once

#include "camera/frame_source.h"
#include "core/result.h"
#include "core/unique_fd.h"

namespace relocd {

/// One file descriptor that is readable when a FrameSource wants to be asked: when its own
/// descriptor is, or its time has come. It stays the same while the source opens and closes its
/// device, so that an event loop can watch it.
class SourceWaiter {
 public:
  static Result<SourceWaiter> Create();

  [[nodiscard]] int fd() const { return epoll_.get(); }

  /// To be called after Start and after each round of Next.
  Result<void> Follow(const FrameSource& source);

 private:
  SourceWaiter(UniqueFd epoll, UniqueFd timer)
      : epoll_(std::move(epoll)), timer_(std::move(timer)) {}

  UniqueFd epoll_;
  UniqueFd timer_;
};

}  // namespace relocd
