// The exact kernel on an octree: depth first, with the list of undecided half-spaces of every cell.
#pragma once

#include "spans.h"
#include "stop.h"
#include "voxels.h"

namespace voxkernel {

struct ExactCells {
  Tiles tiles;
  Leaves leaves;
  Index n_inside = 0;  // in voxels, like n_boundary
  Index n_boundary = 0;
};

ExactCells exact_cells(Points normals, Doubles offsets, Doubles reach, Doubles pads, int depth, bool count_only,
                       Stop& stop);

}  // namespace voxkernel
