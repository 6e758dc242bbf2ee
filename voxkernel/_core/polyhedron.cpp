#include "polyhedron.h"

#include <cmath>

namespace voxkernel {

// Volume, first and second moments about the origin, area, of polygons seen from the origin inside.
Moments moments(Points vertices, Indices start, SmallIndices ring, Stop& stop) {
  Moments sum;
  for (Index f = 0; f + 1 < start.size(); ++f) {
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
  for (int k = 0; k < 3; ++k) {
    for (int m = 0; m < k; ++m) sum.second[m][k] = sum.second[k][m];
  }
  return sum;
}

// Signed solid angle of triangles seen from the origin (van Oosterom and Strackee 1983).
double solid_angle(Points vertices, SmallIndices ring, Stop& stop) {
  double total = 0.0;
  for (Index f = 0; f < ring.size() / 3; ++f) {
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

}  // namespace voxkernel
