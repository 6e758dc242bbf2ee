#include "solid_measures.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "deepest_point.h"

namespace voxkernel {
namespace {

constexpr double kTolerance = 1e-14;
constexpr Index kMostSteps = 2000;

}  // namespace

SolidMeasures solid_measures(Points normals, Doubles offsets, const double* center, Points vertices, Indices start,
                             Indices ring, Indices rows, Stop& stop) {
  SolidMeasures found;
  double square = 0.0;
  for (Index v = 0; v < vertices.size(); ++v) {
    const double* p = vertices[v];
    square = std::max(square, p[0] * p[0] + p[1] * p[1] + p[2] * p[2]);
  }
  found.extent = std::sqrt(square);
  const Moments sums = moments(vertices, start, ring, stop);
  found.volume = sums.volume;
  found.area = sums.area;
  for (int k = 0; k < 3; ++k) found.centroid[k] = sums.first[k] / sums.volume;
  for (int k = 0; k < 3; ++k) {
    for (int m = 0; m < 3; ++m) {
      found.inertia[3 * k + m] = sums.second[k][m] - sums.volume * found.centroid[k] * found.centroid[m];
    }
  }
  // Relative to the size, so that a small kernel is solved as well as a large one.
  HalfSpaceColumns planes(rows.size());
  for (const Index row : rows) {
    const double* n = normals[row];
    planes.push(n, (offsets[row] - (n[0] * center[0] + n[1] * center[1] + n[2] * center[2])) / found.extent, 0.0);
  }
  DeepestPoint solver;
  solver.find(planes, 2.0, kTolerance, kMostSteps, stop);
  double least = std::numeric_limits<double>::infinity();
  for (Index i = 0; i < planes.size; ++i) least = std::min(least, planes.slack(i, solver.point.data()));
  found.clearance = least * found.extent;
  for (int k = 0; k < 3; ++k) found.deepest[k] = solver.point[k] * found.extent;
  return found;
}

}  // namespace voxkernel
