// The least violated point: branch and bound over octree cells, with the lists of planes of descent.h.
#pragma once

#include "descent.h"
#include "spans.h"
#include "stop.h"

namespace voxkernel {

// Stop within `gap`, or within `ratio` of what is reached where that is more; at cells of `max_level`, after
// `max_cells`.
struct Search {
  Index gap;
  double ratio;
  int max_level;
  Index max_cells;
};

struct Least {
  Index best, lower, n_cells;
};

Least least_violated(const CubePlanes& planes, double blur, Index best, const Search& search, double* center,
                     double* open_cell, Stop& stop);

}  // namespace voxkernel
