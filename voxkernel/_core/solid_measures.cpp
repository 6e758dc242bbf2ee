#include "solid_measures.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "deepest_point.h"

namespace voxkernel {
namespace {

constexpr double kTolerance = 1e-14;
constexpr Index kMostSteps = 2000;
constexpr Index kAll = 4096;   // so many planes are solved at once
constexpr Index kSome = 1024;  // of more at first so many, and so many more each time

// The deepest point between planes, relative to the size, so that a small kernel is solved as well as a large one; of
// many planes on a working set, to which the worst of every stretch is added until none is violated.
template <typename Slack>
void find_deepest(Points normals, SmallIndices rows, Slack&& slack, SolidMeasures& found, Stop& stop) {
  const Index n = rows.size(), stretch = n <= kAll ? 1 : (n + kSome - 1) / kSome;
  HalfSpaceColumns planes(0);
  const auto add = [&](const std::vector<Index>& faces) {
    planes.reserve(planes.size + static_cast<Index>(faces.size()));
    for (const Index f : faces) planes.push(normals[rows[f]], slack(f) / found.extent, 0.0);
  };
  std::vector<Index> fresh;
  for (Index f = 0; f < n; f += stretch) fresh.push_back(f);
  DeepestPoint solver;
  const double* point = solver.point.data();
  double least = 0.0;
  while (true) {
    add(fresh);
    const bool is_solved = solver.find(planes, 2.0, kTolerance, kMostSteps, stop) >= 0;
    fresh.clear();
    least = std::numeric_limits<double>::infinity();
    for (Index first = 0; first < n; first += stretch) {
      const Index last = std::min(n, first + stretch);
      stop.poll(last - first);
      double worst = point[3] - kTolerance;
      Index where = -1;
      for (Index f = first; f < last; ++f) {
        const double* m = normals[rows[f]];
        const double left = slack(f) / found.extent - (m[0] * point[0] + m[1] * point[1] + m[2] * point[2]);
        least = std::min(least, left);
        if (left < worst) {
          worst = left;
          where = f;
        }
      }
      if (where >= 0) fresh.push_back(where);
    }
    if (!is_solved || fresh.empty() || planes.size >= n) break;
  }
  found.clearance = least * found.extent;
  for (int k = 0; k < 3; ++k) found.deepest[k] = point[k] * found.extent;
}

}  // namespace

SolidMeasures solid_measures(Points normals, Doubles offsets, const double* center, Points vertices, Indices start,
                             SmallIndices ring, SmallIndices rows, Stop& stop) {
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
  const auto slack = [&](Index f) {
    const double* n = normals[rows[f]];
    return offsets[rows[f]] - (n[0] * center[0] + n[1] * center[1] + n[2] * center[2]);
  };
  find_deepest(normals, rows, slack, found, stop);
  return found;
}

}  // namespace voxkernel
