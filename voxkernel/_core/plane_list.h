// Lists of planes, one array per number, so that a test of a cell is a loop over contiguous memory. The lists of a
// cell and of its ancestors follow one another like on a stack; nothing is allocated for a cell.
//
// A plane is (a, b): a . u <= b, with |a| = 1 up to rounding. For a cell with centre c and half edge h,
// `value` is a . c - b, and `reach` |a|_1 or a little more.
#pragma once

#include <algorithm>
#include <array>
#include <memory>

#include "spans.h"
#include "stop.h"

namespace voxkernel {

// A growable array whose new part is not written to, so that its pages cost nothing before they are used.
template <typename T>
class Column {
 public:
  explicit Column(Index size) : data_(new T[size]), size_(size) {}
  T* data() const { return data_.get(); }
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
  Index size_;
};

// From the centre of a cell to that of a child, and the half edge of the child.
struct Step {
  double x, y, z, h;
};
// Child c is on the upper side of x, y, z where bit 4, 2, 1 is set.
inline Step step_to_child(int c, double h) { return {c & 4 ? h : -h, c & 2 ? h : -h, c & 1 ? h : -h, h}; }

// A pass may read and write this many planes beyond the end of a list.
constexpr Index kSlack = 4;

// Pointers into the columns, valid until they grow.
struct PlaneView {
  double *x, *y, *z, *reach, *value;
  Index* weight;
};

class PlaneList {
 public:
  explicit PlaneList(Index size) : x_(size), y_(size), z_(size), reach_(size), value_(size), weight_(size) {}
  PlaneView view() const { return {x_.data(), y_.data(), z_.data(), reach_.data(), value_.data(), weight_.data()}; }
  void reserve(Index needed) {
    for (Column<double>* column : {&x_, &y_, &z_, &reach_, &value_}) column->reserve(needed + kSlack);
    weight_.reserve(needed + kSlack);
  }

 private:
  Column<double> x_, y_, z_, reach_, value_;
  Column<Index> weight_;
};

// What all of a cell violates for certain, and what some of it can violate.
struct Weights {
  Index certain = 0;
  Index possible = 0;
};

enum class Side { outside, inside, crossing };

// Where a cell is with respect to the planes first..last of a domain: certainly outside one, certainly inside all.
Side domain_side(const PlaneView& planes, Index first, Index last, Step step);
// What the cell itself violates of the planes first..last.
Weights weights_of(const PlaneView& planes, Index first, Index last, Step step);
// The same for the eight children of a cell, those of bit c in `wanted`; h is their half edge. A child that violates
// more than `most` for certain is not looked at to the end.
void weights_of_children(const PlaneView& planes, Index first, Index last, double h, Index most, int wanted,
                         Weights (&children)[8]);
// Copies the planes first..last that the cell may cross to `at` and after; returns where they end.
Index keep_crossing(const PlaneView& planes, Index first, Index last, Index at, Step step);

// The root of an octree is the one child of slot 0, the cube itself; slot l + 1 is a cell of level l.
inline Step step_to_cube() { return {0.0, 0.0, 0.0, 0.5}; }
inline double half_edge(int level) { return 0.5 / static_cast<double>(Index{1} << level); }

// Fills what is known of the children of a cell: their sides of the domain, and what they violate up to `most`.
template <typename Cell>
void look_at_children(Cell& cell, const PlaneView& p, int slot, Index most, Stop& stop) {
  stop.poll(8 * (cell.end - cell.begin) + 8);
  if (slot == 0) {
    const Step step = step_to_cube();
    cell.sides[0] = domain_side(p, cell.begin, cell.middle, step);
    cell.children[0] = weights_of(p, cell.middle, cell.end, step);
    return;
  }
  const double h = half_edge(slot);
  int wanted = 0;
  for (int c = 0; c < 8; ++c) {
    cell.sides[c] = domain_side(p, cell.begin, cell.middle, step_to_child(c, h));
    if (cell.sides[c] != Side::outside) wanted |= 1 << c;
  }
  weights_of_children(p, cell.middle, cell.end, h, most, wanted, cell.children);
}

}  // namespace voxkernel
