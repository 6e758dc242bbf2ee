// Which cells of space may hold a point that sees a spot of a closed surface: what is left out is left out for certain.
#pragma once

#include "spans.h"
#include "stop.h"

namespace voxkernel {

// Distances from the surface at the nodes of a grid, each a bound from below, and only of nodes outside; 0 elsewhere.
struct OutsideGrid {
  const double* distances;  // node (i, j, k) at (i shape[1] + j) shape[2] + k
  Index shape[3];
  double low[3];
  double step;
};

// Sets may_see[i, j] for cells (cubes with centre and half an edge) and spots with their outward normals, which have
// length 1. `parents[i]` is a row of `before`: what the cell around it may see; -1 where there is none.
void cells_may_see(const OutsideGrid& grid, Points centers, Span<const double> halves, Indices parents,
                   Span<const bool> before, Points spots, Points normals, double slack, Span<bool> may_see, Stop& stop);

}  // namespace voxkernel
