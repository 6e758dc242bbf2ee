#include "solid_measures.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "deepest_point.h"
#include "workers.h"

namespace voxkernel {
namespace {

constexpr double kTolerance = 1e-14;
constexpr Index kMostSteps = 2000;
constexpr Index kAll = 4096;   // so many planes are solved at once
constexpr Index kSome = 1024;  // of more at first so many, and so many more each time
constexpr Index kLeast = 128;  // stretches of planes that are worth a thread

// The deepest point between planes, relative to the size, so that a small kernel is solved as well as a large one; of
// many planes on a working set, to which the worst of every stretch is added until none is violated.
template <typename Slack>
void find_deepest(Points normals, SmallIndices rows, Slack&& slack, SolidMeasures& found, int threads, Stop& stop) {
  const Index n = rows.size(), stretch = n <= kAll ? 1 : (n + kSome - 1) / kSome;
  HalfSpaceColumns planes(0);
  const auto add = [&](const std::vector<Index>& faces) {
    planes.reserve(planes.size + static_cast<Index>(faces.size()));
    for (const Index f : faces) planes.push(normals[rows[f]], slack(f) / found.extent, 0.0);
  };
  struct Worst {
    double least;  // slack of all
    Index where;   // the plane that is violated most, -1 where none is
  };
  std::vector<Worst> worst((n + stretch - 1) / stretch);
  std::vector<Index> fresh;
  for (Index f = 0; f < n; f += stretch) fresh.push_back(f);
  DeepestPoint solver;
  const double* point = solver.point.data();
  double least = 0.0;
  while (true) {
    add(fresh);
    const bool is_solved = solver.find(planes, 2.0, kTolerance, kMostSteps, stop) >= 0;
    run_stretches(static_cast<Index>(worst.size()), stretch == 1 ? n : kLeast, threads, stop,
                  [&](Index begin, Index end, Stop& own) {
                    for (Index part = begin; part < end; ++part) {
                      const Index last = std::min(n, (part + 1) * stretch);
                      own.poll(stretch);
                      Worst now{std::numeric_limits<double>::infinity(), -1};
                      for (Index f = part * stretch; f < last; ++f) {
                        const double* m = normals[rows[f]];
                        const double left =
                            slack(f) / found.extent - (m[0] * point[0] + m[1] * point[1] + m[2] * point[2]);
                        if (left < now.least) now = {left, left < point[3] - kTolerance ? f : -1};
                      }
                      worst[part] = now;
                    }
                  });
    fresh.clear();
    least = std::numeric_limits<double>::infinity();
    for (const Worst& part : worst) {
      least = std::min(least, part.least);
      if (part.where >= 0) fresh.push_back(part.where);
    }
    if (!is_solved || fresh.empty() || planes.size >= n) break;
  }
  found.clearance = least * found.extent;
  for (int k = 0; k < 3; ++k) found.deepest[k] = point[k] * found.extent;
}

}  // namespace

SolidMeasures solid_measures(Points normals, Doubles offsets, const double* center, Points vertices, Indices start,
                             SmallIndices ring, SmallIndices rows, int threads, Stop& stop) {
  SolidMeasures found;
  double square = 0.0;
  for (Index v = 0; v < vertices.size(); ++v) {
    const double* p = vertices[v];
    square = std::max(square, p[0] * p[0] + p[1] * p[1] + p[2] * p[2]);
  }
  found.extent = std::sqrt(square);
  const Moments sums = moments(vertices, start, ring, threads, stop);
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
  find_deepest(normals, rows, slack, found, threads, stop);
  return found;
}

}  // namespace voxkernel
