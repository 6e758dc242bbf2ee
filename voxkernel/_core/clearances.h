// Distances from triangles, each a bound from below up to the rounding of a few sums.
#pragma once

#include "sight_tree.h"

namespace voxkernel {

// Fills a bound from below on the distance of each point from the triangles; slivers do not make it too large.
void clearances(const SightTree& tree, Points points, Span<double> distances, Stop& stop);

}  // namespace voxkernel
