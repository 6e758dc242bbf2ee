// Arrays that grow together, one for each number of a plane.
#pragma once

#include <algorithm>
#include <array>
#include <memory>
#include <utility>

#include "spans.h"

namespace voxkernel {

// A growable array whose new part is not written to, so that its pages cost nothing before they are used.
template <typename T>
class Column {
 public:
  Column() = default;
  explicit Column(Index size) : data_(new T[size]), size_(size) {}
  T* data() const { return data_.get(); }
  T& operator[](Index i) const {
    check_bound(i, size_);
    return data_[i];
  }
  Index size() const { return size_; }
  void reserve(Index needed) {
    if (needed <= size_) return;
    Index size = size_;
    while (size < needed) size = 2 * size + 64;
    std::unique_ptr<T[]> bigger(new T[size]);
    std::copy_n(data_.get(), size_, bigger.get());
    data_ = std::move(bigger);
    size_ = size;
  }

 private:
  std::unique_ptr<T[]> data_;
  Index size_ = 0;
};

// A pass may read and write this many planes beyond the end of a list.
constexpr Index kSlack = 4;

// Columns of floating-point numbers and of integers that grow together.
template <std::size_t n_numbers, std::size_t n_integers>
class ColumnSet {
 public:
  explicit ColumnSet(Index size) {
    for (Column<double>& column : numbers_) column = Column<double>(size);
    for (Column<Index>& column : integers_) column = Column<Index>(size);
  }
  void reserve(Index needed) {
    for (Column<double>& column : numbers_) column.reserve(needed + kSlack);
    for (Column<Index>& column : integers_) column.reserve(needed + kSlack);
  }

 protected:
  // Column k, null where there is none.
  template <std::size_t k>
  double* numbers() const {
    if constexpr (k < n_numbers) return numbers_[k].data();
    return nullptr;
  }
  template <std::size_t k>
  Index* integers() const {
    if constexpr (k < n_integers) return integers_[k].data();
    return nullptr;
  }

 private:
  std::array<Column<double>, n_numbers> numbers_;
  std::array<Column<Index>, n_integers> integers_;
};

}  // namespace voxkernel
