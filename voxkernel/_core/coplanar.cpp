#include "coplanar.h"

#include <algorithm>
#include <cmath>

#include "predicates.h"

namespace voxkernel {
namespace {

// Coplanar facets have nearly the same (n, d), so nearly the same key: a fixed generic linear function of those.
constexpr double kDirection[3] = {0.4142135, 0.7320508, -0.2360679};
constexpr double kOffsetFactor = 0.6457513;
constexpr double kWindow = 1e-11;
// So many groups within the window are tried; where planes lie denser, some stay apart.
constexpr int kMostTried = 6;

struct Keyed {
  double key;
  Index facet;
};

// Whether the exact predicate covers all corners in use.
bool within_range(Points vertices, Triangles corners) {
  for (Index i = 0; i < corners.size(); ++i) {
    if (corners(i, 0) < 0) continue;
    for (int k = 0; k < 3; ++k) {
      const double* p = vertices[corners(i, k)];
      for (int axis = 0; axis < 3; ++axis) {
        const double size = std::abs(p[axis]);
        if (size != 0.0 && !(size >= 0x1p-300 && size <= 0x1p300)) return false;
      }
    }
  }
  return true;
}

// Whether the corners of one triangle lie exactly on the plane of another.
bool are_coplanar(Points vertices, const Index* plane, const Index* other) {
  const double* a = vertices[plane[0]];
  const double* b = vertices[plane[1]];
  const double* c = vertices[plane[2]];
  for (int k = 0; k < 3; ++k) {
    const Index v = other[k];
    if (v == plane[0] || v == plane[1] || v == plane[2]) continue;
    const double* d = vertices[v];
    const auto same = [&](int axis) { return a[axis] == b[axis] && a[axis] == c[axis] && a[axis] == d[axis]; };
    if (same(0) || same(1) || same(2)) continue;
    if (orient3d_exact(a, b, c, d) != 0.0) return false;
  }
  return true;
}

}  // namespace

// Names for each facet the first one that is exactly coplanar with it and faces the same way.
//
// Rows of `corners` that are negative are never grouped, and nothing is where a coordinate in use is beyond
// 2**-300 .. 2**300. Facets so thin that their rounded planes differ by more than the window are left alone.
std::vector<Index> coplanar_groups(Points normals, Doubles offsets, Points vertices, Triangles corners, Stop& stop) {
  const Index n = offsets.size();
  std::vector<Index> groups(n);
  for (Index i = 0; i < n; ++i) groups[i] = i;
  if (!within_range(vertices, corners)) return groups;
  std::vector<Keyed> order;
  order.reserve(n);
  for (Index i = 0; i < n; ++i) {
    if (corners(i, 0) < 0) continue;
    const double* normal = normals[i];
    const double along = normal[0] * kDirection[0] + normal[1] * kDirection[1] + normal[2] * kDirection[2];
    order.push_back({along + kOffsetFactor * offsets[i], i});
  }
  // By key, then by facet: a total order.
  std::sort(order.begin(), order.end(), [&](const Keyed& a, const Keyed& b) {
    stop.poll();
    return a.key < b.key || (a.key == b.key && a.facet < b.facet);
  });
  std::vector<Keyed> heads;  // the first of each group so far, by key
  for (const Keyed& next : order) {
    const Index i = next.facet;
    stop.poll(8);
    int tried = 0;
    for (auto head = heads.rbegin(); head != heads.rend() && tried < kMostTried; ++head, ++tried) {
      if (!(next.key - head->key <= kWindow)) break;
      const Index j = head->facet;
      double gap = std::abs(offsets[i] - offsets[j]);
      for (int k = 0; k < 3; ++k) gap += std::abs(normals(i, k) - normals(j, k));
      if (gap <= 4.0 * kWindow && are_coplanar(vertices, corners[j], corners[i])) {
        groups[i] = j;
        break;
      }
    }
    if (groups[i] == i) heads.push_back(next);
  }
  // Name each group by its first facet, whatever the order of the keys was.
  std::vector<Index> first(n, n);
  for (Index i = 0; i < n; ++i) first[groups[i]] = std::min(first[groups[i]], i);
  for (Index i = 0; i < n; ++i) groups[i] = first[groups[i]];
  return groups;
}

}  // namespace voxkernel
