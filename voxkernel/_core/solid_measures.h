// Size, moments and a largest ball of a convex polyhedron about the origin.
#pragma once

#include "polyhedron.h"
#include "spans.h"
#include "stop.h"

namespace voxkernel {

struct SolidMeasures {
  double extent = 0.0;  // the farthest vertex from the origin
  double volume = 0.0, area = 0.0;
  double centroid[3] = {0.0, 0.0, 0.0};
  double inertia[9] = {};  // second central moment
  double deepest[3] = {0.0, 0.0, 0.0};
  double clearance = 0.0;  // smallest distance of `deepest` from a plane
};

// The same for any number of threads. `vertices` are from `center`; polygon f, on the plane of half-space rows[f], is
// ring[start[f]:start[f + 1]].
SolidMeasures solid_measures(Points normals, Doubles offsets, const double* center, Points vertices, Indices start,
                             SmallIndices ring, SmallIndices rows, int threads, Stop& stop);

}  // namespace voxkernel
