#pragma once

#include <cstddef>
#include <utility>
#include <vector>

namespace relocd {

/// A sequence that grows at its end and shrinks at its front, in one piece of memory.
///
/// It allocates only while it has never held so many: what is taken from the front leaves room that
/// is used again, by moving the rest there. So a window that slides forever needs no allocation.
/// Pointers and iterators end with each change, as those of a vector that grows.
template <typename T>
class SlidingVector {
 public:
  using value_type = T;  // NOLINT(readability-identifier-naming): containers' own name for it

  SlidingVector() = default;
  explicit SlidingVector(std::size_t capacity) { Reserve(capacity); }

  /// Makes room for `capacity` at a time, twice: so the rest is moved once in so many removals.
  void Reserve(std::size_t capacity) { items_.reserve(2 * capacity); }

  [[nodiscard]] std::size_t size() const { return items_.size() - begin_; }
  [[nodiscard]] bool empty() const { return items_.size() == begin_; }

  T& operator[](std::size_t i) { return items_[begin_ + i]; }
  const T& operator[](std::size_t i) const { return items_[begin_ + i]; }
  T& front() { return items_[begin_]; }
  [[nodiscard]] const T& front() const { return items_[begin_]; }
  T& back() { return items_.back(); }
  [[nodiscard]] const T& back() const { return items_.back(); }

  T* begin() { return items_.data() + begin_; }
  T* end() { return items_.data() + items_.size(); }
  [[nodiscard]] const T* begin() const { return items_.data() + begin_; }
  [[nodiscard]] const T* end() const { return items_.data() + items_.size(); }

  void push_back(T item) {
    MakeRoom();
    items_.push_back(std::move(item));
  }

  /// Puts an item before `position`, and returns where it is.
  T* insert(T* position, T item) {
    const std::ptrdiff_t index = position - begin();
    MakeRoom();
    const auto at = items_.begin() + static_cast<std::ptrdiff_t>(begin_) + index;
    return &*items_.insert(at, std::move(item));
  }

  /// Needs an item.
  void pop_front() {
    ++begin_;
    if (empty()) clear();
  }

  void clear() {
    items_.clear();
    begin_ = 0;
  }

 private:
  void MakeRoom() {
    if (items_.size() < items_.capacity() || 2 * begin_ < items_.size()) return;
    items_.erase(items_.begin(), items_.begin() + static_cast<std::ptrdiff_t>(begin_));
    begin_ = 0;
  }

  std::vector<T> items_;
  std::size_t begin_ = 0;
};

}  // namespace relocd
