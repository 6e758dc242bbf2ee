// The least violated point: branch and bound over octree cells, best first, with the lists of facet_lists.h.
#pragma once

#include "facet_lists.h"
#include "spans.h"
#include "stop.h"

namespace voxkernel {

// The planes of a domain, in the unit cube.
struct Border {
  Points normals;
  Doubles offsets, pads;
};

// Stop within `gap`, or within `ratio` of what is reached where that is more; at cells of `max_level`, which is at most
// 42; after `max_cells`, or when as many planes were looked at as these have with 2,048 each.
struct Search {
  Index gap;
  double ratio;
  int max_level;
  Index max_cells;
  int threads;
};

struct Least {
  Index best, lower, n_cells;
  bool is_over;  // whether cells or planes were too many
};

Least least_violated(const FramedPlanes& facets, const Border& border, double blur, Index best, const Search& search,
                     double* center, double* open_cell, Stop& stop);

}  // namespace voxkernel
