#include "cell_planes.h"

#include <algorithm>
#include <cmath>

#include "polygon_spread.h"

namespace voxkernel {
namespace {

// Relative; polygons so near a threshold of `from_polygons` are left to it.
constexpr double kGuard = 1e-3;

struct Vector {
  double x, y, z;
};

// (b - a) x (c - a).
Vector cross(const double* a, const double* b, const double* c) {
  const double ux = b[0] - a[0], uy = b[1] - a[1], uz = b[2] - a[2];
  const double vx = c[0] - a[0], vy = c[1] - a[1], vz = c[2] - a[2];
  return {uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx};
}

// `visit(a, b, c)` for the triangles of every fan.
template <typename Visit>
void each_triangle(Points points, const Polygons& polygons, Visit&& visit) {
  for (Index f = 0; f < polygons.n_faces; ++f) {
    const Index low = polygons.start[f], high = polygons.start[f + 1];
    const Index apex = low + polygons.apex[f];
    const double* a = points[polygons.ring[apex]];
    Index at = apex + 1 == high ? low : apex + 1;
    const double* b = points[polygons.ring[at]];
    for (Index k = low + 2; k < high; ++k) {
      at = at + 1 == high ? low : at + 1;
      const double* c = points[polygons.ring[at]];
      visit(a, b, c);
      b = c;
    }
  }
}

// `visit(a, b)` for the directed edges of every polygon, but those from a corner to itself.
template <typename Visit>
void each_edge(const Cell& cell, Visit&& visit) {
  for (Index f = 0; f < cell.n_faces; ++f) {
    const Index low = cell.start[f], high = cell.start[f + 1];
    Index a = cell.ring[high - 1];
    for (Index j = low; j < high; ++j) {
      const Index b = cell.ring[j];
      if (a != b) visit(a, b);
      a = b;
    }
  }
}

void sort(Index* first, Index* last) {
  if (last - first > 32) {
    std::sort(first, last);
    return;
  }
  for (Index* next = first + 1; next < last; ++next) {
    const Index key = *next;
    Index* p = next;
    for (; p > first && p[-1] > key; --p) *p = p[-1];
    *p = key;
  }
}

}  // namespace

// Edges are bucketed by their smaller vertex, so that the time is about linear.
EdgeBalance EdgeCheck::balance(const Cell& cell) {
  const Index n = cell.n_vertices;
  std::fill_n(start_.begin(), n + 1, 0);
  each_edge(cell, [&](Index a, Index b) { ++start_[std::min(a, b) + 1]; });
  for (Index v = 0; v < n; ++v) {
    start_[v + 1] += start_[v];
    fill_[v] = start_[v];
  }
  each_edge(cell, [&](Index a, Index b) { keys_[fill_[std::min(a, b)]++] = a < b ? 2 * b : 2 * a + 1; });
  Index n_open = 0, n_turned = 0;
  for (Index v = 0; v < n; ++v) {
    const Index high = start_[v + 1];
    sort(keys_.data() + start_[v], keys_.data() + high);
    for (Index j = start_[v]; j < high;) {
      const Index other = keys_[j] >> 1;
      Index balance = 0, uses = 0;
      for (; j < high && (keys_[j] >> 1) == other; ++j, ++uses) balance += 1 - 2 * (keys_[j] & 1);
      if (uses & 1) {
        ++n_open;
      } else if (balance != 0) {
        ++n_turned;
      }
    }
  }
  if (n_open != 0) return {Closing::kOpen, n_open};
  return {n_turned != 0 ? Closing::kTurned : Closing::kClosed, n_turned};
}

PolygonPlanes::PolygonPlanes(Index most_corners)
    : corners(3 * most_corners), face(most_corners), extra(most_corners), is_planar(most_corners) {}

void PolygonPlanes::push(Index a, Index b, Index c, double off) {
  Index* row = corners.data() + 3 * n_planes;
  row[0] = a;
  row[1] = b;
  row[2] = c;
  extra[n_planes++] = off;
}

bool PolygonPlanes::set(Cell& cell, double rtol, Index most, Stop& stop) {
  n_planes = 0;
  const Indices ring = cell.ring;
  for (Index f = 0; f < cell.n_faces; ++f) {
    const Index before = n_planes;
    if (!add(cell.points(), ring.part(cell.start[f], cell.start[f + 1]), rtol, cell.apex[f], stop)) return false;
    if (n_planes > most) return false;
    is_planar[f] = n_planes == before + 1;
    std::fill(face.begin() + before, face.begin() + n_planes, f);
  }
  return true;
}

// Appends the planes of one polygon.
bool PolygonPlanes::add(Points points, Indices ring, double rtol, Index& apex, Stop& stop) {
  const Index size = ring.size();
  apex = 0;
  if (size == 3) {
    push(ring[0], ring[1], ring[2], 0.0);
    return true;
  }
  if (size > kMostPairedCorners) return false;
  if (static_cast<Index>(x_.size()) < 2 * size) {
    for (auto* values : {&x_, &y_, &z_}) values->resize(2 * size);
  }
  const double* o = points[ring[0]];
  for (Index k = 0; k < size; ++k) {
    const double* p = points[ring[k]];
    x_[k] = x_[size + k] = p[0] - o[0];
    y_[k] = y_[size + k] = p[1] - o[1];
    z_[k] = z_[size + k] = p[2] - o[2];
  }
  const Spread spread = spread_corners(x_.data(), y_.data(), z_.data(), size, stop);
  double sum[3] = {0.0, 0.0, 0.0};
  for (Index k = 1; k < size - 1; ++k) {
    const Vector n = cross(o, points[ring[k]], points[ring[k + 1]]);
    sum[0] += 0.5 * n.x;
    sum[1] += 0.5 * n.y;
    sum[2] += 0.5 * n.z;
  }
  const double side = std::sqrt(sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2]);
  const double length = std::sqrt(spread.square);
  const Index a = ring[spread.i], b = ring[spread.j], c = ring[spread.far];
  const double* pa = points[a];
  const Vector n = cross(pa, points[b], points[c]);
  const double facing = n.x * sum[0] + n.y * sum[1] + n.z * sum[2];
  if (length == 0.0 || side <= 1e-9 * length || std::abs(facing) <= 1e-6 * side * length) return false;
  double height = 0.0;
  for (Index k = 0; k < size; ++k) {
    const double* p = points[ring[k]];
    const double x = p[0] - pa[0], y = p[1] - pa[1], z = p[2] - pa[2];
    height = std::max(height, std::abs(n.x * x + n.y * y + n.z * z));
  }
  const double limit = rtol * std::sqrt(spread.best) * length;
  if (std::abs(height - limit) <= kGuard * limit) return false;
  if (height < limit) {
    // The corners are this far off the plane, and `length` / diameter is the width they rest on.
    const double off = 4.0 * height * std::sqrt(spread.best) / spread.square;
    push(facing < 0.0 ? b : a, facing < 0.0 ? a : b, c, off);
    return true;
  }
  return add_fan(points, ring, sum, apex);
}

// Cuts a polygon into a fan from its first or second corner, whichever keeps its side throughout.
bool PolygonPlanes::add_fan(Points points, Indices ring, const double* sum, Index& apex) {
  const Index size = ring.size(), before = n_planes;
  const double floor = 1e-14 * (sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2]);
  for (apex = 0; apex < 2; ++apex) {
    bool clear = true;
    n_planes = before;
    for (Index k = 1; k < size - 1 && clear; ++k) {
      const Index next = apex + k + 1;
      const Index a = ring[apex], b = ring[next - 1], c = ring[next < size ? next : 0];
      const Vector n = cross(points[a], points[b], points[c]);
      const double facing = n.x * sum[0] + n.y * sum[1] + n.z * sum[2];
      if (std::abs(facing) <= 100.0 * floor) return false;
      clear = !(facing < 0.0);
      if (clear) push(a, b, c, 0.0);
    }
    if (clear) return true;
  }
  return false;
}

Bounded fan_volume(Points points, const Polygons& polygons) {
  double total = 0.0, size = 0.0;
  each_triangle(points, polygons, [&](const double* a, const double* b, const double* c) {
    const double x1 = b[1] * c[2], x2 = b[2] * c[1];
    const double y1 = b[2] * c[0], y2 = b[0] * c[2];
    const double z1 = b[0] * c[1], z2 = b[1] * c[0];
    total += a[0] * (x1 - x2) + a[1] * (y1 - y2) + a[2] * (z1 - z2);
    size += std::abs(a[0]) * (std::abs(x1) + std::abs(x2)) + std::abs(a[1]) * (std::abs(y1) + std::abs(y2)) +
            std::abs(a[2]) * (std::abs(z1) + std::abs(z2));
  });
  const double n_terms = 6.0 + static_cast<double>(polygons.start[polygons.n_faces] - polygons.start[0]);
  return {total, (16.0 + n_terms) * 0x1p-53 * size};
}

double fan_area(Points points, const Polygons& polygons) {
  double total = 0.0;
  each_triangle(points, polygons, [&](const double* a, const double* b, const double* c) {
    const Vector n = cross(a, b, c);
    total += 0.5 * std::sqrt(n.x * n.x + n.y * n.y + n.z * n.z);
  });
  return total;
}

double solid_angle(Points points, const Polygons& polygons, const double* center) {
  double total = 0.0;
  each_triangle(points, polygons, [&](const double* pa, const double* pb, const double* pc) {
    const double ax = pa[0] - center[0], ay = pa[1] - center[1], az = pa[2] - center[2];
    const double bx = pb[0] - center[0], by = pb[1] - center[1], bz = pb[2] - center[2];
    const double cx = pc[0] - center[0], cy = pc[1] - center[1], cz = pc[2] - center[2];
    const double la = std::sqrt(ax * ax + ay * ay + az * az);
    const double lb = std::sqrt(bx * bx + by * by + bz * bz);
    const double lc = std::sqrt(cx * cx + cy * cy + cz * cz);
    const double triple = ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx);
    double below = la * lb * lc;
    below += (ax * bx + ay * by + az * bz) * lc + (bx * cx + by * cy + bz * cz) * la;
    below += (cx * ax + cy * ay + cz * az) * lb;
    total += 2.0 * std::atan2(triple, below);
  });
  return total;
}

// Four maxima side by side: one would wait for the comparison before it.
double squared_diameter(Points points, Stop& stop) {
  double best[4] = {0.0, 0.0, 0.0, 0.0};
  for (Index i = 0; i < points.size(); ++i) {
    stop.poll(i);
    const double* p = points[i];
    const auto compare = [&](Index j, double& most) {
      const double* q = points[j];
      const double x = p[0] - q[0], y = p[1] - q[1], z = p[2] - q[2];
      most = std::max(most, x * x + y * y + z * z);
    };
    Index j = 0;
    for (; j + 4 <= i; j += 4) {
      for (int k = 0; k < 4; ++k) compare(j + k, best[k]);
    }
    for (; j < i; ++j) compare(j, best[0]);
  }
  return std::max(std::max(best[0], best[1]), std::max(best[2], best[3]));
}

}  // namespace voxkernel
