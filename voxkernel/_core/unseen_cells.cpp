#include "unseen_cells.h"

#include <algorithm>
#include <cmath>

namespace voxkernel {
namespace {

// A bound from below on the distance from the surface at y, if y is outside for certain; else 0 or less. `slack` is far
// above every rounding here.
double outside_by(const OutsideGrid& grid, const double* y, double slack) {
  Index at[3];
  double part[3];
  for (int k = 0; k < 3; ++k) {
    const double f = (y[k] - grid.low[k]) / grid.step;
    if (!(f >= 0.0 && f < static_cast<double>(grid.shape[k] - 1))) return 0.0;
    at[k] = static_cast<Index>(f);
    part[k] = f - static_cast<double>(at[k]);
  }
  double best = 0.0;
  for (int corner = 0; corner < 8; ++corner) {
    const int d[3] = {corner & 1, (corner >> 1) & 1, corner >> 2};
    const double distance =
        grid.distances[((at[0] + d[0]) * grid.shape[1] + at[1] + d[1]) * grid.shape[2] + at[2] + d[2]];
    if (distance <= 0.0) continue;
    double square = 0.0;
    for (int k = 0; k < 3; ++k) square += (part[k] - d[k]) * (part[k] - d[k]);
    best = std::max(best, distance - grid.step * std::sqrt(square) - slack);
  }
  return best;
}

// If x in the ball about c with radius r sees q, then x + t (q - x) is in the solid and within (1 - t) r of
// c + t (q - c); so no x does where that point is outside by more.
bool is_hidden(const OutsideGrid& grid, const double* c, double radius, const double* q, double slack, Stop& stop) {
  double square = 0.0;
  for (int k = 0; k < 3; ++k) square += (q[k] - c[k]) * (q[k] - c[k]);
  const int steps = static_cast<int>(std::sqrt(square) / (0.7 * grid.step)) + 1;
  stop.poll(8 * steps);
  for (int s = 0; s < steps; ++s) {
    const double t = static_cast<double>(s) / steps;
    double y[3];
    for (int k = 0; k < 3; ++k) y[k] = c[k] + t * (q[k] - c[k]);
    if (outside_by(grid, y, slack) > (1.0 - t) * radius + slack) return true;
  }
  return false;
}

}  // namespace

void cells_may_see(const OutsideGrid& grid, Points centers, Span<const double> halves, Indices parents,
                   Span<const bool> before, Points spots, Points normals, double slack, Span<bool> may_see,
                   Stop& stop) {
  const Index n = spots.size();
  for (Index i = 0; i < centers.size(); ++i) {
    const double* c = centers[i];
    const double radius = halves[i] * std::sqrt(3.0) + slack;
    for (Index j = 0; j < n; ++j) {
      stop.poll();
      may_see[i * n + j] = false;
      if (parents[i] >= 0 && !before[parents[i] * n + j]) continue;
      double value = 0.0, reach = 0.0;
      for (int k = 0; k < 3; ++k) {
        value += normals(j, k) * (c[k] - spots(j, k));
        reach += std::abs(normals(j, k));
      }
      if (value - halves[i] * reach > slack) continue;  // all of the cell is behind the facet
      may_see[i * n + j] = !is_hidden(grid, c, radius, spots[j], slack, stop);
    }
  }
}

}  // namespace voxkernel
