// Deepest point of a working set of half-spaces by a dual simplex, and passes over all of them.
#pragma once

#include "spans.h"
#include "stop.h"

namespace voxkernel {

// Direction bins: the faces of a cube, 8 x 8 cells each.
constexpr int kBins = 6 * 8 * 8;

// Constraints 0..5 are the box, 6 caps t, 7 + w is half-space rows[w].
Index deepest_point(Points normals, Doubles offsets, Indices rows, double box, Span<Index> basis,
                    Span<double> multipliers, Span<double> point, double tolerance, Index max_steps, Stop& stop);

struct Tightest {
  double smallest;  // slack
  double certain;   // smallest slack minus its error bound
  Index where;      // plane of the smallest slack
};
Tightest tightest_by_direction(Points normals, Doubles offsets, Doubles errors, const double* point, double limit,
                               Span<Index> ids, Span<double> slacks, Stop& stop);

std::vector<Index> plane_signs(Points normals, Doubles offsets, Doubles errors, const double* point, double slack_error,
                               Stop& stop);

}  // namespace voxkernel
