#pragma once

#include <functional>
#include <map>

#include "core/result.h"
#include "core/time.h"
#include "core/unique_fd.h"

namespace relocd {

/// Waits for file descriptors and timers on one thread, and calls their handlers, until the process
/// is asked to end.
///
/// Thread-bound. Handlers run one at a time, and must not block.
class EventLoop {
 public:
  using Handler = std::function<void()>;

  /// Blocks SIGINT and SIGTERM for this thread and those it starts later, so that they end Run
  /// rather than the process, and ignores SIGPIPE: a log that nobody reads any more must not end it
  /// either. Call it before starting any thread.
  static Result<EventLoop> Create();

  /// Calls `handler` whenever `fd`, which stays the caller's, can be read.
  Result<void> OnReadable(int fd, Handler handler);

  /// Calls `handler` once per `period`; calls that fall due while another handler runs are merged.
  Result<void> Every(Duration period, Handler handler);

  /// Runs handlers until SIGINT, SIGTERM or Stop.
  Result<void> Run();

  /// Ends Run after the handler that calls this.
  void Stop() { running_ = false; }

 private:
  EventLoop(UniqueFd epoll, UniqueFd signals)
      : epoll_(std::move(epoll)), signals_(std::move(signals)) {}

  void HandleReadable(int fd);

  UniqueFd epoll_;
  UniqueFd signals_;
  std::map<int, UniqueFd> timers_;
  std::map<int, Handler> handlers_;
  bool running_ = false;
};

}  // namespace relocd
