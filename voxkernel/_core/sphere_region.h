// Convex polytopes `normals . x <= offsets`: the point nearest to another one, and segments that meet them.
#pragma once

#include "spans.h"
#include "stop.h"

namespace voxkernel {

bool nearest_point(Points normals, Doubles offsets, const double* z, double tolerance, double* y, Stop& stop);
bool edges_meet(Points starts, Points ends, Points normals, Doubles offsets, Stop& stop);

}  // namespace voxkernel
