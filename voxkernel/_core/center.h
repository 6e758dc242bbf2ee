// The least violated point: branch and bound over octree cells, with lists of planes like those of plane_list.h.
#pragma once

#include "spans.h"
#include "stop.h"

namespace voxkernel {

// Planes of the unit cube, the first `n_domain` those of a domain; `pads` cover all rounding.
struct PaddedPlanes {
  Points normals;
  Doubles offsets, reach, pads;
  Indices weights;
  Index n_domain;
};

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

Least least_violated(const PaddedPlanes& planes, double blur, Index best, const Search& search, double* center,
                     double* open_cell, Stop& stop);

}  // namespace voxkernel
