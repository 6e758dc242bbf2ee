// Volume and moments of a convex polyhedron.
#pragma once

#include "spans.h"
#include "stop.h"

namespace voxkernel {

struct Moments {
  double volume = 0.0;
  double first[3] = {0.0, 0.0, 0.0};
  double second[3][3] = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  double area = 0.0;
};
// The same for any number of threads.
Moments moments(Points vertices, Indices start, SmallIndices ring, int threads, Stop& stop);
double solid_angle(Points vertices, SmallIndices ring, int threads, Stop& stop);

}  // namespace voxkernel
