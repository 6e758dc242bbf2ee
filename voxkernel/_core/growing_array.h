// An array that grows and is handed over as it is: the system moves its pages, so that it is never held twice.
#pragma once

#include <algorithm>
#include <cstdlib>
#include <new>
#include <type_traits>
#include <utility>

#include "spans.h"

namespace voxkernel {

template <typename T>
class GrowingArray {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  GrowingArray() { resize_room(kLeast); }
  GrowingArray(const GrowingArray&) = delete;
  GrowingArray& operator=(const GrowingArray&) = delete;
  ~GrowingArray() { std::free(data_); }

  void push(T value) {
    if (size_ == room_) resize_room(std::max(kLeast, room_ + room_ / 2));
    data_[size_++] = value;
  }
  // Room for so many, which takes memory only as far as it is filled.
  void reserve(Index room) {
    if (room > room_) resize_room(room);
  }
  Index size() const { return size_; }
  T& operator[](Index i) {
    check_bound(i, size_);
    return data_[i];
  }
  // The memory, which the caller frees; what is left is empty.
  T* release() {
    resize_room(size_ > 0 ? size_ : 1);
    size_ = room_ = 0;
    return std::exchange(data_, nullptr);
  }

 private:
  static constexpr Index kLeast = 1024;

  void resize_room(Index room) {
    void* moved = std::realloc(static_cast<void*>(data_), static_cast<std::size_t>(room) * sizeof(T));
    if (moved == nullptr) throw std::bad_alloc();
    data_ = static_cast<T*>(moved);
    room_ = room;
  }

  T* data_ = nullptr;
  Index size_ = 0;
  Index room_ = 0;
};

}  // namespace voxkernel
