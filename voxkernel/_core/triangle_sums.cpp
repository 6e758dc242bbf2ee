#include "triangle_sums.h"

#include <algorithm>
#include <cmath>

#include "scaling.h"

namespace voxkernel {

namespace {

constexpr Index kStretch = 128;  // triangles whose corners are fetched before anything is made of them
constexpr Index kBlock = 32 * kStretch;

// Coordinates of corners by columns: nine for each triangle.
struct Corners {
  std::array<std::array<double, kStretch>, 9> columns;

  void fetch(Points vertices, Triangles triangles, Index first, Index n) {
    for (Index i = 0; i < n; ++i) {
      const Index* ids = triangles[first + i];
      for (int corner = 0; corner < 3; ++corner) {
        const double* at = vertices[ids[corner]];
        for (int k = 0; k < 3; ++k) columns[3 * corner + k][i] = at[k];
      }
    }
  }
  // Every coordinate becomes `moved(axis, coordinate)`.
  template <typename Moved>
  void move(Index n, Moved&& moved) {
    for (int column = 0; column < 9; ++column) {
      for (Index i = 0; i < n; ++i) columns[column][i] = moved(column % 3, columns[column][i]);
    }
  }
  // From differences of corners.
  void areas(double* found, Index n) const {
    const auto& c = columns;
    for (Index i = 0; i < n; ++i) {
      const double ux = c[3][i] - c[0][i], uy = c[4][i] - c[1][i], uz = c[5][i] - c[2][i];
      const double vx = c[6][i] - c[0][i], vy = c[7][i] - c[1][i], vz = c[8][i] - c[2][i];
      const double x = uy * vz - uz * vy, y = uz * vx - ux * vz, z = ux * vy - uy * vx;
      found[i] = 0.5 * std::sqrt(x * x + y * y + z * z);
    }
  }
  double middle(int k, Index i) const { return (columns[k][i] + columns[3 + k][i] + columns[6 + k][i]) / 3.0; }
};

template <std::size_t N>
void add(std::array<double, N>& sum, const std::array<double, N>& part) {
  for (std::size_t k = 0; k < N; ++k) sum[k] += part[k];
}

void add(TriangleMoments& sum, const TriangleMoments& part) {
  sum.area += part.area;
  add(sum.first, part.first);
  add(sum.second, part.second);
  add(sum.third, part.third);
  add(sum.corners, part.corners);
}

std::array<double, 6> squares(double weight, double x, double y, double z) {
  const double wx = weight * x, wy = weight * y;
  return {wx * x, wx * y, wx * z, wy * y, wy * z, weight * z * z};
}

void count(TriangleMoments& sums, double area, double x, double y, double z) {
  const auto [xx, xy, xz, yy, yz, zz] = squares(area, x, y, z);
  sums.area += area;
  add(sums.first, {area * x, area * y, area * z});
  add(sums.second, {xx, xy, xz, yy, yz, zz});
  add(sums.third, {xx * x, xx * y, xx * z, xy * y, xy * z, xz * z, yy * y, yy * z, yz * z, zz * z});
}

}  // namespace

void triangle_areas(Points vertices, Triangles triangles, int exponent, Span<double> areas, Stop& stop) {
  const Scaling scaled(exponent);
  Corners corners;
  for (Index first = 0; first < triangles.size(); first += kStretch) {
    const Index n = std::min(kStretch, triangles.size() - first);
    stop.poll(n);
    corners.fetch(vertices, triangles, first, n);
    corners.move(n, [&](int, double x) { return scaled(x); });
    corners.areas(areas.part(first, first + n).data(), n);
  }
}

TriangleMoments triangle_moments(Points vertices, Triangles triangles, const std::array<double, 3>& base, double unit,
                                 Stop& stop) {
  Corners corners;
  std::array<double, kStretch> areas;
  const double factor = 1.0 / unit;
  TriangleMoments total, block;
  for (Index first = 0; first < triangles.size(); first += kStretch) {
    const Index n = std::min(kStretch, triangles.size() - first);
    stop.poll(n);
    corners.fetch(vertices, triangles, first, n);
    corners.move(n, [&](int axis, double x) { return (x - base[axis]) * factor; });
    corners.areas(areas.data(), n);
    const auto& c = corners.columns;
    for (Index i = 0; i < n; ++i) {
      count(block, areas[i], corners.middle(0, i), corners.middle(1, i), corners.middle(2, i));
      for (int k = 0; k < 9; k += 3) add(block.corners, squares(areas[i], c[k][i], c[k + 1][i], c[k + 2][i]));
    }
    if ((first + n) % kBlock != 0 && first + n < triangles.size()) continue;
    add(total, block);
    block = {};
  }
  return total;
}

}  // namespace voxkernel
