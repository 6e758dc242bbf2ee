// Groups of exactly coplanar facets.
#pragma once

#include "spans.h"
#include "stop.h"

namespace voxkernel {

std::vector<Index> coplanar_groups(Points normals, Doubles offsets, Points vertices, Triangles corners, Stop& stop);

}  // namespace voxkernel
