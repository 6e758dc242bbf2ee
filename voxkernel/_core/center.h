// The least violated point: branch and bound over octree cells, best first, with the lists of planes of descent.h.
#pragma once

#include "descent.h"
#include "spans.h"
#include "stop.h"

namespace voxkernel {

// Stop within `gap`, or within `ratio` of what is reached where that is more; at cells of `max_level`, which is at most
// 42; after `max_cells`, or when as many planes were looked at as these have with 2,048 each.
struct Search {
  Index gap;
  double ratio;
  int max_level;
  Index max_cells;
};

struct Least {
  Index best, lower, n_cells;
  bool is_over;  // whether cells or planes were too many
};

Least least_violated(const CubePlanes& planes, double blur, Index best, const Search& search, double* center,
                     double* open_cell, Stop& stop);

}  // namespace voxkernel
