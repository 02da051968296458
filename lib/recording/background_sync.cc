#include "recording/background_sync.h"

#include <unistd.h>

#include <utility>

#include "core/file.h"

namespace relocd {

BackgroundSync::BackgroundSync() : thread_([this](const std::stop_token& stop) { Run(stop); }) {}

void BackgroundSync::Request(UniqueFd file) {
  {
    const std::lock_guard lock(mutex_);
    file_ = std::move(file);
  }
  has_file_.notify_one();
}

Result<void> BackgroundSync::last_result() const {
  const std::lock_guard lock(mutex_);
  return last_result_;
}

void BackgroundSync::Run(const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  while (true) {
    has_file_.wait(lock, stop, [this] { return file_.has_value(); });
    if (!file_) return;  // asked to stop, and nothing waits
    const UniqueFd file = std::move(*file_);
    file_.reset();
    lock.unlock();
    Result<void> result;
    if (::fdatasync(file.get()) != 0) {
      result = SystemError(ErrorKind::kUnavailable, "syncing the log");
    }
    lock.lock();
    last_result_ = std::move(result);
  }
}

}  // namespace relocd
