// How many voxels an object has in each line of voxels along an axis.
#pragma once

#include "label_crop.h"
#include "spans.h"
#include "stop.h"

namespace voxkernel {

// By the other two axes of the crop, row by row: (i, j), (i, k), (j, k).
struct LineCounts {
  Span<Index> ij, ik, jk;
};
void line_counts(const Crop& crop, const LineCounts& counts, Stop& stop);

}  // namespace voxkernel
