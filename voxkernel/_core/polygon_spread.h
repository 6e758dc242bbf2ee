// Three corners of a polygon that lie well apart: two of the farthest ones, and the one farthest from their line.
#pragma once

#include "spans.h"
#include "stop.h"

namespace voxkernel {

// Of polygons with more corners, all pairs would take too long.
constexpr Index kMostPairedCorners = 256;

// The diameter of a polygon, the corner farthest from it, and the squares of the diameter and of twice the area of the
// triangle of the three.
struct Spread {
  Index i, j, far;
  double best, square;
};

// Coordinates relative to the first corner, each list written twice in a row. Squares are summed as x, z, y: ties are
// broken by their rounding.
Spread spread_corners(const double* x, const double* y, const double* z, Index size, Stop& stop);

}  // namespace voxkernel
