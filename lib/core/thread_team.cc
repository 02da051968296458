#include "core/thread_team.h"

#include <chrono>

#include "core/check.h"

namespace relocd {

PartRange RangeOfPart(int count, int part, int parts) {
  const auto at = [count, parts](int index) {
    return static_cast<int>(static_cast<std::int64_t>(count) * index / parts);
  };
  return {at(part), at(part + 1)};
}

namespace {

constexpr std::chrono::microseconds kLookOut{40};

/// Returns when `value` is no longer `old`: soon after, and without sleeping if it is soon.
template <typename Number>
void WaitWhile(const std::atomic<Number>& value, Number old) {
  const auto start = std::chrono::steady_clock::now();
  while (std::chrono::steady_clock::now() - start < kLookOut) {
    if (value.load(std::memory_order_acquire) != old) return;
  }
  value.wait(old, std::memory_order_acquire);
}

}  // namespace

ThreadTeam::ThreadTeam(int size) {
  RELOCD_CHECK(size >= 1, "a team has at least one thread");
  for (int part = 1; part < size; ++part) {
    helpers_.emplace_back([this, part] { Help(part); });
  }
}

ThreadTeam::~ThreadTeam() {
  work_ = nullptr;
  round_.fetch_add(1, std::memory_order_release);
  round_.notify_all();
}

void ThreadTeam::Run(const std::function<void(int part)>& work) {
  if (helpers_.empty()) return work(0);
  work_ = &work;
  busy_.store(static_cast<int>(helpers_.size()), std::memory_order_relaxed);
  round_.fetch_add(1, std::memory_order_release);
  round_.notify_all();
  work(0);
  for (int busy = busy_.load(std::memory_order_acquire); busy != 0;
       busy = busy_.load(std::memory_order_acquire)) {
    WaitWhile(busy_, busy);
  }
}

void ThreadTeam::Help(int part) {
  for (std::uint32_t seen = 0;; ++seen) {
    WaitWhile(round_, seen);
    if (work_ == nullptr) return;
    (*work_)(part);
    if (busy_.fetch_sub(1, std::memory_order_acq_rel) == 1) busy_.notify_one();
  }
}

}  // namespace relocd
