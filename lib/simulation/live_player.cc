#include "simulation/live_player.h"

#include <algorithm>
#include <chrono>
#include <thread>

namespace relocd {
namespace {

/// How often it is looked for an image that is late.
constexpr Duration kPoll = std::chrono::milliseconds(1);

}  // namespace

LivePlayer::Clock LivePlayer::WallClock() {
  return {.now = [] { return MonotonicTime(MonotonicClock::now()); },
          .sleep_until = [](MonotonicTime time) { std::this_thread::sleep_until(time); }};
}

Result<void> LivePlayer::Play(MonotonicTime epoch, const std::atomic<bool>& stop) {
  epoch_ = epoch;
  next_frame_ = outputs_.send_frame ? 0 : drive_.frames.size();
  next_image_ = outputs_.show_image ? 0 : drive_.image_times_ns.size();
  while (!stop) {
    const bool is_over =
        next_frame_ == drive_.frames.size() && next_image_ == drive_.image_times_ns.size();
    if (is_over) return {};
    const MonotonicTime wake_up = NextWakeUp(clock_.now());
    clock_.sleep_until(wake_up);
    const MonotonicTime now = clock_.now();
    if (auto ok = SendFrames(now); !ok) return ok;
    if (auto ok = ShowImage(now); !ok) return ok;
  }
  return {};
}

MonotonicTime LivePlayer::ImageDue(std::size_t image) const {
  return epoch_ + Duration(drive_.image_times_ns[image]);
}

MonotonicTime LivePlayer::NextWakeUp(MonotonicTime now) const {
  MonotonicTime next = MonotonicTime::max();
  if (next_frame_ < drive_.frames.size())
    next = epoch_ + Duration(drive_.frames[next_frame_].time_ns);
  if (next_image_ < drive_.image_times_ns.size())
    next = std::min(next, std::max(ImageDue(next_image_), now + kPoll));
  return next;
}

Result<void> LivePlayer::SendFrames(MonotonicTime now) {
  while (next_frame_ < drive_.frames.size()) {
    const CandumpRecord& record = drive_.frames[next_frame_];
    const Duration lateness = now - (epoch_ + Duration(record.time_ns));
    if (lateness < Duration::zero()) return {};
    if (auto ok = outputs_.send_frame(record.frame); !ok) return ok;
    ++next_frame_;
    ++counters_.frames;
    counters_.late_frames += lateness > kLate ? 1 : 0;
    counters_.worst_frame = std::max(counters_.worst_frame, lateness);
  }
  return {};
}

Result<void> LivePlayer::ShowImage(MonotonicTime now) {
  while (next_image_ < drive_.image_times_ns.size() && ImageDue(next_image_) <= now) {
    const bool is_superseded =
        next_image_ + 1 < drive_.image_times_ns.size() && ImageDue(next_image_ + 1) <= now;
    if (is_superseded) {
      ++next_image_;
      ++counters_.dropped_images;
      continue;
    }
    auto image = drive_.image(next_image_);
    if (!image) return std::move(image).error();
    if (!image->has_value()) return {};
    if (auto ok = outputs_.show_image(**image); !ok) return ok;
    const Duration lateness = now - ImageDue(next_image_);
    ++next_image_;
    ++counters_.images;
    counters_.late_images += lateness > kLate ? 1 : 0;
    counters_.worst_image = std::max(counters_.worst_image, lateness);
  }
  return {};
}

}  // namespace relocd
