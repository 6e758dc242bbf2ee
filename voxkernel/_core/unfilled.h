// Vectors whose elements are not filled before they are written: a resize touches no memory, so that threads share it.
#pragma once

#include <cstddef>
#include <memory>
#include <new>
#include <utility>
#include <vector>

namespace voxkernel {

// Of an allocator: elements that are not given are not filled. Who writes them first, on whatever thread, touches their
// pages.
struct Unconstructed {
  template <typename U>
  void construct(U* place) noexcept {
    ::new (static_cast<void*>(place)) U;
  }
  template <typename U, typename... Given>
  void construct(U* place, Given&&... given) {
    ::new (static_cast<void*>(place)) U(std::forward<Given>(given)...);
  }
};

template <typename T>
struct Unfilled : std::allocator<T>, Unconstructed {
  template <typename U>
  struct rebind {
    using other = Unfilled<U>;
  };
  Unfilled() = default;
  template <typename U>
  Unfilled(const Unfilled<U>& /*other*/) noexcept {}
};

template <typename T>
using UnfilledVector = std::vector<T, Unfilled<T>>;

}  // namespace voxkernel
