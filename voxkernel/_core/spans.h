// Views of arrays that somebody else owns: flat, and rows of fixed width. Bounds are asserted where asked for.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <vector>

namespace voxkernel {

using Index = std::int64_t;

// With VOXKERNEL_CHECKED every access is tested; a release build trusts its caller.
inline void check_bound([[maybe_unused]] Index i, [[maybe_unused]] Index n) {
#ifdef VOXKERNEL_CHECKED
  if (i < 0 || i >= n) throw std::out_of_range("index " + std::to_string(i) + " of " + std::to_string(n));
#endif
}

template <typename T>
class Span {
 public:
  Span() = default;
  Span(T* data, Index size) : data_(data), size_(size) {}
  // A vector is a span of its elements, also one of constants.
  template <typename U, typename A>
  Span(std::vector<U, A>& values) : data_(values.data()), size_(static_cast<Index>(values.size())) {}
  template <typename U, typename A>
  Span(const std::vector<U, A>& values) : data_(values.data()), size_(static_cast<Index>(values.size())) {}
  operator Span<const T>() const { return {data_, size_}; }

  T& operator[](Index i) const {
    check_bound(i, size_);
    return data_[i];
  }
  Span part(Index first, Index last) const {
    check_bound(first, size_ + 1);
    check_bound(last, size_ + 1);
    return {data_ + first, last - first};
  }
  Index size() const { return size_; }
  T* data() const { return data_; }
  T* begin() const { return data_; }
  T* end() const { return data_ + size_; }

 private:
  T* data_ = nullptr;
  Index size_ = 0;
};

// Rows of N numbers, one behind the other: `rows[i][k]` or `rows(i, k)`.
template <typename T, int N>
class Rows {
 public:
  Rows() = default;
  Rows(T* data, Index size) : data_(data), size_(size) {}
  operator Rows<const T, N>() const { return {data_, size_}; }

  T* operator[](Index i) const {
    check_bound(i, size_);
    return data_ + N * i;
  }
  T& operator()(Index i, Index k) const {
    check_bound(k, N);
    return (*this)[i][k];
  }
  Index size() const { return size_; }
  T* data() const { return data_; }

 private:
  T* data_ = nullptr;
  Index size_ = 0;
};

using Doubles = Span<const double>;
using Indices = Span<const Index>;
using SmallIndices = Span<const std::int32_t>;  // of what is less than 2**31
using Points = Rows<const double, 3>;
using Triangles = Rows<const Index, 3>;

}  // namespace voxkernel
