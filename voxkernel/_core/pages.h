// Large arrays that last for a while only: no memory before they are used, and given back to the system as soon as they
// are freed. Freed arrays of the usual kind stay with the process, between others, so that its peak is higher.
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <memory>
#include <new>
#include <vector>

#ifdef __linux__
#include <sys/mman.h>
#endif

#include "unfilled.h"

namespace voxkernel {

template <typename T>
struct Pages : Unconstructed {
  using value_type = T;

  Pages() = default;
  template <typename U>
  Pages(const Pages<U>& /*other*/) noexcept {}

  T* allocate(std::size_t n) {
#ifdef __linux__
    if (n > std::numeric_limits<std::size_t>::max() / sizeof(T)) throw std::bad_alloc();
    if (n >= kLarge) {
      void* memory = mmap(nullptr, n * sizeof(T), PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
      if (memory == MAP_FAILED) throw std::bad_alloc();
      return static_cast<T*>(memory);
    }
#endif
    return std::allocator<T>().allocate(n);
  }
  void deallocate(T* memory, std::size_t n) noexcept {
#ifdef __linux__
    if (n >= kLarge) {
      munmap(memory, n * sizeof(T));
      return;
    }
#endif
    std::allocator<T>().deallocate(memory, n);
  }
  // Gives back what lies behind the first `least`, as far as it can; returns how many are left.
  std::size_t shrink([[maybe_unused]] T* memory, std::size_t n, [[maybe_unused]] std::size_t least) noexcept {
#ifdef __linux__
    if (n >= kLarge) {
      constexpr std::size_t page = std::size_t{1} << 16;  // of any system, or several
      const std::size_t kept = (std::max(least, kLarge) * sizeof(T) + page - 1) / page * page;
      if (kept < n * sizeof(T)) {
        munmap(reinterpret_cast<char*>(memory) + kept, n * sizeof(T) - kept);
        return kept / sizeof(T);
      }
    }
#endif
    return n;
  }

  bool operator==(const Pages& /*other*/) const { return true; }
  bool operator!=(const Pages& /*other*/) const { return false; }

 private:
  static constexpr std::size_t kLarge = ((std::size_t{1} << 18) + sizeof(T) - 1) / sizeof(T);
};

template <typename T>
using Brief = std::vector<T, Pages<T>>;

// An array that is not filled.
template <typename T>
class BriefArray {
 public:
  explicit BriefArray(std::size_t n) : data_(Pages<T>().allocate(n)), size_(n) {}
  BriefArray(const BriefArray&) = delete;
  BriefArray& operator=(const BriefArray&) = delete;
  ~BriefArray() { reset(); }

  T* get() { return data_; }
  T& operator[](std::ptrdiff_t i) { return data_[i]; }
  const T& operator[](std::ptrdiff_t i) const { return data_[i]; }
  void shrink(std::size_t least) { size_ = Pages<T>().shrink(data_, size_, least); }
  void reset() {
    if (data_ != nullptr) Pages<T>().deallocate(data_, size_);
    data_ = nullptr;
  }

 private:
  T* data_;
  std::size_t size_;
};

}  // namespace voxkernel
