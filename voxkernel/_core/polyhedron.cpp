#include "polyhedron.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "workers.h"

namespace voxkernel {
namespace {

// Sums over so many polygons are added in their order, whoever made them.
constexpr Index kBlock = 4096;

// The sums `sum_of(first, last, stop)` of the blocks of 0 .. n, in their order.
template <typename Sum, typename SumOf>
std::vector<Sum> block_sums(Index n, int threads, Stop& stop, SumOf&& sum_of) {
  std::vector<Sum> sums((n + kBlock - 1) / kBlock);
  run_stretches(static_cast<Index>(sums.size()), 1, threads, stop, [&](Index begin, Index end, Stop& own) {
    for (Index block = begin; block < end; ++block) {
      sums[block] = sum_of(block * kBlock, std::min(n, (block + 1) * kBlock), own);
    }
  });
  return sums;
}

Moments moments_of(Points vertices, Indices start, SmallIndices ring, Index begin, Index end, Stop& stop) {
  Moments sum;
  for (Index f = begin; f < end; ++f) {
    const Index low = start[f];
    stop.poll(start[f + 1] - low);
    for (Index j = low + 1; j < start[f + 1] - 1; ++j) {
      const double* a = vertices[ring[low]];
      const double* b = vertices[ring[j]];
      const double* c = vertices[ring[j + 1]];
      const double ux = b[0] - a[0], uy = b[1] - a[1], uz = b[2] - a[2];
      const double vx = c[0] - a[0], vy = c[1] - a[1], vz = c[2] - a[2];
      const double nx = uy * vz - uz * vy, ny = uz * vx - ux * vz, nz = ux * vy - uy * vx;
      sum.area += 0.5 * std::sqrt(nx * nx + ny * ny + nz * nz);
      const double part = (a[0] * nx + a[1] * ny + a[2] * nz) / 6.0;
      sum.volume += part;
      for (int k = 0; k < 3; ++k) {
        sum.first[k] += part * (a[k] + b[k] + c[k]) / 4.0;
        for (int m = 0; m <= k; ++m) {
          const double total = (a[k] + b[k] + c[k]) * (a[m] + b[m] + c[m]);
          sum.second[k][m] += part * (a[k] * a[m] + b[k] * b[m] + c[k] * c[m] + total) / 20.0;
        }
      }
    }
  }
  return sum;
}

double angle_of(Points vertices, SmallIndices ring, Index begin, Index end, Stop& stop) {
  double total = 0.0;
  for (Index f = begin; f < end; ++f) {
    stop.poll(4);
    const double* a = vertices[ring[3 * f]];
    const double* b = vertices[ring[3 * f + 1]];
    const double* c = vertices[ring[3 * f + 2]];
    const auto dot = [](const double* u, const double* v) { return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]; };
    const double la = std::sqrt(dot(a, a)), lb = std::sqrt(dot(b, b)), lc = std::sqrt(dot(c, c));
    const double triple =
        a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0]);
    const double below = la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb;
    total += 2.0 * std::atan2(triple, below);
  }
  return total;
}

}  // namespace

// Volume, first and second moments about the origin, area, of polygons seen from the origin inside.
Moments moments(Points vertices, Indices start, SmallIndices ring, int threads, Stop& stop) {
  Moments sum;
  const auto parts = block_sums<Moments>(start.size() - 1, threads, stop, [&](Index first, Index last, Stop& own) {
    return moments_of(vertices, start, ring, first, last, own);
  });
  for (const Moments& part : parts) {
    sum.volume += part.volume;
    sum.area += part.area;
    for (int k = 0; k < 3; ++k) {
      sum.first[k] += part.first[k];
      for (int m = 0; m <= k; ++m) sum.second[k][m] += part.second[k][m];
    }
  }
  for (int k = 0; k < 3; ++k) {
    for (int m = 0; m < k; ++m) sum.second[m][k] = sum.second[k][m];
  }
  return sum;
}

// Signed solid angle of triangles seen from the origin (van Oosterom and Strackee 1983).
double solid_angle(Points vertices, SmallIndices ring, int threads, Stop& stop) {
  const auto parts = block_sums<double>(ring.size() / 3, threads, stop, [&](Index first, Index last, Stop& own) {
    return angle_of(vertices, ring, first, last, own);
  });
  double total = 0.0;
  for (const double part : parts) total += part;
  return total;
}

}  // namespace voxkernel
