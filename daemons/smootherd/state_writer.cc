#include "smootherd/state_writer.h"

#include <filesystem>
#include <system_error>
#include <utility>

#include "core/file.h"

namespace relocd {

StateWriter::StateWriter(std::string path)
    : path_(std::move(path)), thread_([this](const std::stop_token& stop) { Run(stop); }) {}

void StateWriter::Write(std::string text) {
  {
    const std::lock_guard lock(mutex_);
    text_ = std::move(text);
  }
  has_text_.notify_one();
}

Result<void> StateWriter::last_result() const {
  const std::lock_guard lock(mutex_);
  return last_result_;
}

void StateWriter::Run(const std::stop_token& stop) {
  std::error_code no_folder;  // then the first write says so
  std::filesystem::create_directories(std::filesystem::path(path_).parent_path(), no_folder);
  std::unique_lock lock(mutex_);
  while (true) {
    has_text_.wait(lock, stop, [this] { return text_.has_value(); });
    if (!text_) return;  // asked to stop, and nothing waits
    const std::string text = *std::exchange(text_, std::nullopt);
    lock.unlock();
    auto result = WriteFileAtomically(path_, text);
    lock.lock();
    last_result_ = std::move(result);
  }
}

}  // namespace relocd
