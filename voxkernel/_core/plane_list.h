// Lists of planes, one array per number, so that a test of a cell is a loop over contiguous memory. The lists of a
// cell and of its ancestors follow one another like on a stack; nothing is allocated for a cell.
//
// A plane is (a, b): a . u <= b, with |a| = 1 up to rounding. For a cell with centre c and half edge h, `value` is
// a . c - b. Where a list has pads, `reach` is |a|_1 and r = h * reach + pad; where it has none, they are a part of
// `reach` and r = h * reach. Why r and -r are certain: plane_bounds.h.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>

#include "columns.h"
#include "spans.h"
#include "stop.h"

namespace voxkernel {

// Pointers into the columns, valid until they grow; null where a list has no such column.
struct PlaneView {
  double *x, *y, *z, *reach, *value, *pad;
  Index* weight;

  void set(Index i, const double* a, double r, double v) const {
    x[i] = a[0];
    y[i] = a[1];
    z[i] = a[2];
    reach[i] = r;
    value[i] = v;
  }
};

template <bool has_pad, bool has_weight>
class PlaneList : public ColumnSet<has_pad ? 6 : 5, has_weight ? 1 : 0> {
 public:
  using ColumnSet<has_pad ? 6 : 5, has_weight ? 1 : 0>::ColumnSet;
  PlaneView view() const {
    return {this->template numbers<0>(), this->template numbers<1>(), this->template numbers<2>(),
            this->template numbers<3>(), this->template numbers<4>(), this->template numbers<5>(),
            this->template integers<0>()};
  }
};

// The value of a plane at the centre of the unit cube.
inline double value_in_cube(const double* a, double b) { return 0.5 * (a[0] + a[1] + a[2]) - b; }

// From the centre of a cell to that of a child, and the half edge of the child.
struct Step {
  double x, y, z, h;
};
// Child c is on the upper side of x, y, z where bit 4, 2, 1 is set.
inline Step child_step(int c, double h) { return {c & 4 ? h : -h, c & 2 ? h : -h, c & 1 ? h : -h, h}; }

// Sums of weights: what all of a cell violates for certain, and what may be violated as far as the limits look.
struct Weights {
  Index certain = 0;
  Index possible = 0;
};

enum class Side { outside, inside, crossing };

// Limits say from which value on a plane may be violated; above r all of a cell violates it.
// In some of the cell: from -r on. For lists without pads.
struct CellLimits {
  static constexpr bool has_pad = false;
};
// At its centre, which may be moved by `blur` later: above -pad - blur. For lists with pads.
struct CentreLimits {
  static constexpr bool has_pad = true;
  double blur;
};

// Where a cell is with respect to the planes first..last of a domain: all of it certainly outside one, as far as the
// limits look certainly inside all, or neither.
template <typename Limits>
Side domain_side(const PlaneView& planes, Index first, Index last, const Step& step, const Limits& limits);
// What the cell itself violates of the planes first..last.
template <typename Limits>
Weights weights_of(const PlaneView& planes, Index first, Index last, const Step& step, const Limits& limits);
constexpr Index kNoLimit = std::numeric_limits<Index>::max();
// The same for the eight children of a cell, those of bit c in `wanted`; h is their half edge. A child that violates
// more than `most` for certain is not looked at to the end.
template <typename Limits>
void weights_of_children(const PlaneView& planes, Index first, Index last, double h, Index most, int wanted,
                         const Limits& limits, Weights (&children)[8]);
// Which of the eight children each of the first n planes of a list with pads may cross, child c by bit c; by the same
// numbers as the weights of children. Planes beyond n are read, as far as kSlack.
void crossed_children(const PlaneView& planes, Index n, double h, std::uint8_t* children);
// Copies the planes first..last that the cell may cross to `at` and after, weights among them; returns where they end.
template <bool has_pad>
Index keep_crossing(const PlaneView& planes, Index first, Index last, Index at, const Step& step);
// The same for a list with pads and without weights; when the cell is certainly outside plane t, returns -1 - t.
Index keep_undecided(const PlaneView& planes, Index first, Index last, Index at, const Step& step);

}  // namespace voxkernel
