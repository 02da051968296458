#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <thread>
#include <vector>

namespace relocd {

/// The rows, of `count`, that one of `parts` equal parts has.
struct PartRange {
  int begin = 0;
  int end = 0;
};
PartRange RangeOfPart(int count, int part, int parts);

/// Threads that do parts of one thing side by side. They look out for the next thing for some tens
/// of microseconds, since waking takes as long, and then sleep: unlike OpenMP's, they do not take a
/// core while nothing is to be done.
///
/// Used by one thread at a time.
class ThreadTeam {
 public:
  /// @param size  >= 1; one of them is the thread that calls Run.
  explicit ThreadTeam(int size);
  ~ThreadTeam();
  ThreadTeam(const ThreadTeam&) = delete;
  ThreadTeam& operator=(const ThreadTeam&) = delete;
  ThreadTeam(ThreadTeam&&) = delete;
  ThreadTeam& operator=(ThreadTeam&&) = delete;

  [[nodiscard]] int size() const { return static_cast<int>(helpers_.size()) + 1; }

  /// Calls `work(part)` for each part in [0, size()), at the same time, and returns when all have
  /// returned. `work` must not throw.
  void Run(const std::function<void(int part)>& work);

 private:
  void Help(int part);

  const std::function<void(int)>* work_ = nullptr;  ///< Null: the helpers are to end.
  std::atomic<std::uint32_t> round_ = 0;            ///< How often there was something to do.
  std::atomic<int> busy_ = 0;  ///< Helpers that have not returned from this round's work.
  std::vector<std::jthread> helpers_;
};

/// The caller alone.
inline std::shared_ptr<ThreadTeam> TeamOfOne() {
  return std::make_shared<ThreadTeam>(1);
}

}  // namespace relocd
