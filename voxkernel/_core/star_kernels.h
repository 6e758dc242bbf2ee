// Kernels of star polyhedra that are given by lengths of rays: many of one kind, one after the other.
#pragma once

#include "spans.h"
#include "stop.h"

namespace voxkernel {

// One row a polyhedron; boxes are the lower, then the upper corner. Outcome 1: done; 0: floating point does not tell.
struct StarKernelAnswers {
  Span<double> volumes;
  Rows<double, 6> boxes;
  Span<std::int8_t> outcomes;
};

// The polyhedra first .. last - 1 with corners distances[p, r] * directions[r], all distances positive, and triangles
// that turn so that the origin is behind each.
void star_kernels(Points directions, Triangles faces, Doubles distances, Index first, Index last,
                  const StarKernelAnswers& answers, Stop& stop);

}  // namespace voxkernel
