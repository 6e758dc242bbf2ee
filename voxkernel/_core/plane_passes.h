// Passes over all half-spaces: what is tightest at a point, and which a point is not certainly inside of. Errors are
// those of n . x - d over |x| + 1.
#pragma once

#include <vector>

#include "spans.h"
#include "stop.h"

namespace voxkernel {

// Direction bins: the faces of a cube, 8 x 8 cells each.
constexpr int kBins = 6 * 8 * 8;

struct Tightest {
  double smallest;  // slack
  double certain;   // smallest slack minus its error bound
  Index where;      // plane of the smallest slack
};
// The same for any number of threads.
Tightest tightest_by_direction(Points normals, Doubles offsets, Doubles errors, const double* point, double limit,
                               Span<Index> ids, Span<double> slacks, int threads, Stop& stop);

std::vector<Index> plane_signs(Points normals, Doubles offsets, Doubles errors, const double* point, double slack_error,
                               Stop& stop);

}  // namespace voxkernel
