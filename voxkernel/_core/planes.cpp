#include "planes.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace voxkernel {
namespace {

constexpr double kUnitRoundoff = 0x1p-53;
// Triangles with |e1||e2| above this multiple of twice their area are left to exact arithmetic.
constexpr double kMaxSlenderness = 1e6;
// Up to this multiple, the first corner will do as the apex.
constexpr double kRoundEnough = 4.0;

bool equal(const double* a, const double* b) { return a[0] == b[0] && a[1] == b[1] && a[2] == b[2]; }

}  // namespace

// Fills unit normals, offsets, areas and relative error bounds; returns the number left undecided.
//
// The corner opposite the longest edge is the best apex of the cross product; where the first corner is
// nearly as good, it is taken without a choice, which is what most facets need.
// `errors[i]` bounds the error of n . x - d divided by |x| + 1, for local x; it is -1 where the plane
// must be computed exactly and -2 where two corners coincide (no area).
// Bound: an edge has relative error u, a cross product of edges 7 u |e1||e2|, its direction twice that
// over |e1 x e2|; the dot products add less than 8 u (|x| + 1).
Index facet_planes(Points vertices, Triangles corners, const double* origin, double inverse_scale,
                   Rows<double, 3> normals, Span<double> offsets, Span<double> areas, Span<double> errors, Stop& stop) {
  Index undecided = 0;
  const double ox = origin[0], oy = origin[1], oz = origin[2];
  for (Index i = 0; i < corners.size(); ++i) {
    stop.poll();
    const double* a = vertices[corners(i, 0)];
    const double* b = vertices[corners(i, 1)];
    const double* c = vertices[corners(i, 2)];
    // The edges c to a and a to b: a is the apex unless its angle is small or wide.
    double ux = (a[0] - c[0]) * inverse_scale, uy = (a[1] - c[1]) * inverse_scale, uz = (a[2] - c[2]) * inverse_scale;
    double vx = (b[0] - a[0]) * inverse_scale, vy = (b[1] - a[1]) * inverse_scale, vz = (b[2] - a[2]) * inverse_scale;
    const double* apex = a;
    double nx = uy * vz - uz * vy, ny = uz * vx - ux * vz, nz = ux * vy - uy * vx;
    double square = nx * nx + ny * ny + nz * nz;
    const double ca = ux * ux + uy * uy + uz * uz;
    const double ab = vx * vx + vy * vy + vz * vz;
    double product = ca * ab;
    double error = (20.0 * kRoundEnough + 8.0) * kUnitRoundoff;
    if (product < 1e-270 || square * (kRoundEnough * kRoundEnough) < product) {
      const double qx = (c[0] - b[0]) * inverse_scale, qy = (c[1] - b[1]) * inverse_scale,
                   qz = (c[2] - b[2]) * inverse_scale;
      const double bc = qx * qx + qy * qy + qz * qz;
      if (ab >= bc && ab >= ca) {  // c is the apex
        product = bc * ca;
        vx = ux, vy = uy, vz = uz;
        ux = qx, uy = qy, uz = qz;
        apex = c;
      } else if (ca >= bc) {  // b is the apex
        product = ab * bc;
        ux = vx, uy = vy, uz = vz;
        vx = qx, vy = qy, vz = qz;
        apex = b;
      }
      nx = uy * vz - uz * vy;
      ny = uz * vx - ux * vz;
      nz = ux * vy - uy * vx;
      square = nx * nx + ny * ny + nz * nz;
      if (square > 0.0) error = (20.0 * std::sqrt(product / square) + 8.0) * kUnitRoundoff;
    }
    if (product < 1e-270 || !(square * (kMaxSlenderness * kMaxSlenderness) > product)) {
      std::fill_n(normals[i], 3, 0.0);
      offsets[i] = 0.0;
      areas[i] = 0.0;
      const bool is_edge = equal(a, b) || equal(a, c) || equal(b, c);
      errors[i] = is_edge ? -2.0 : -1.0;
      undecided += !is_edge;
      continue;
    }
    const double length = std::sqrt(square);
    const double inverse = 1.0 / length;
    nx *= inverse;
    ny *= inverse;
    nz *= inverse;
    normals(i, 0) = nx;
    normals(i, 1) = ny;
    normals(i, 2) = nz;
    offsets[i] = nx * ((apex[0] - ox) * inverse_scale) + ny * ((apex[1] - oy) * inverse_scale) +
                 nz * ((apex[2] - oz) * inverse_scale);
    areas[i] = 0.5 * length;
    errors[i] = error;
  }
  return undecided;
}

// The bounding box of the vertices that faces refer to, and their smallest magnitude but zero.
Box coordinate_range(Points vertices, Triangles faces, Stop& stop) {
  std::vector<char> is_used(vertices.size(), 0);
  for (Index i = 0; i < faces.size(); ++i) {
    stop.poll();
    for (int k = 0; k < 3; ++k) is_used[faces(i, k)] = 1;
  }
  constexpr double infinity = std::numeric_limits<double>::infinity();
  Box box{{infinity, infinity, infinity}, {-infinity, -infinity, -infinity}, infinity};
  for (Index i = 0; i < vertices.size(); ++i) {
    stop.poll();
    if (!is_used[i]) continue;
    for (int k = 0; k < 3; ++k) {
      const double v = vertices(i, k);
      box.low[k] = std::min(box.low[k], v);
      box.high[k] = std::max(box.high[k], v);
      const double size = std::abs(v);
      if (size > 0.0 && size < box.smallest) box.smallest = size;
    }
  }
  return box;
}

// Whether every edge is traversed equally often in both directions: the surface bounds a volume.
// Edges are bucketed by their smaller vertex, so the time is linear; nothing is hashed.
bool boundary_is_zero(Triangles faces, Index n_vertices, Stop& stop) {
  std::vector<Index> start(n_vertices + 1, 0);
  const auto each_edge = [&](auto&& visit) {
    for (Index i = 0; i < faces.size(); ++i) {
      stop.poll();
      for (int k = 0; k < 3; ++k) {
        const Index a = faces(i, k), b = faces(i, k == 2 ? 0 : k + 1);
        if (a != b) visit(a, b);
      }
    }
  };
  each_edge([&](Index a, Index b) { ++start[std::min(a, b) + 1]; });
  for (Index i = 0; i < n_vertices; ++i) start[i + 1] += start[i];
  std::vector<Index> position(start.begin(), start.end() - 1);
  std::vector<Index> keys(start[n_vertices]);
  each_edge([&](Index a, Index b) { keys[position[std::min(a, b)]++] = a < b ? 2 * b : 2 * a + 1; });
  for (Index i = 0; i < n_vertices; ++i) {
    const Index high = start[i + 1];
    stop.poll(1 + high - start[i]);
    std::sort(keys.begin() + start[i], keys.begin() + high);
    for (Index j = start[i]; j < high;) {
      const Index other = keys[j] >> 1;
      Index balance = 0;
      for (; j < high && (keys[j] >> 1) == other; ++j) balance += 1 - 2 * (keys[j] & 1);
      if (balance != 0) return false;
    }
  }
  return true;
}

}  // namespace voxkernel
