#include "polygon_cuts.h"

#include <algorithm>
#include <cmath>

namespace voxkernel {
namespace {

using Vector = std::array<double, 3>;

Vector crossed(const Vector& u, const Vector& v) {
  return {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]};
}
// Signs near zero and ties depend on the order of the sum, which is therefore the same everywhere.
double dot(const Vector& u, const Vector& v) { return u[0] * v[0] + u[2] * v[2] + u[1] * v[1]; }
double length(const Vector& u) { return std::sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2]); }

}  // namespace

PolygonCuts::PolygonCuts(Points points, Indices flat, Indices sizes, int exponent, double rtol, Stop& stop)
    : points_(points), scaled_(exponent), exponent_(exponent) {
  const Index n = flat.size() - 2 * sizes.size();
  triangles.resize(3 * n);
  facet_ids.resize(n);
  plane_corners.reserve(3 * n);
  plane_facets.reserve(n);
  plane_areas.reserve(n);
  Index at = 0;
  for (Index polygon = 0; polygon < sizes.size(); ++polygon) {
    const Index size = sizes[polygon];
    stop.poll(size);
    std::fill_n(facet_ids.begin() + n_triangles_, size - 2, polygon);
    add(polygon, flat.part(at, at + size), rtol, stop);
    if (!unfanned.empty() && unfanned.back().polygon == polygon) unfanned.back().corner = at;
    at += size;
  }
}

// Of a triangle, half the product of two edges; of others the sum over all edges, by which floats tell the side.
void PolygonCuts::add(Index polygon, Indices ring, double rtol, Stop& stop) {
  const Index size = ring.size();
  load(ring);
  const double *x = x_.data(), *y = y_.data(), *z = z_.data();
  const auto corner = [&](Index k) { return Vector{x[k], y[k], z[k]}; };
  Vector newell{0.0, 0.0, 0.0};
  for (Index k = 1; k < size - 1; ++k) {  // the first corner is 0: the edges at it add nothing
    const Vector c = crossed(corner(k), corner(k + 1));
    for (int axis = 0; axis < 3; ++axis) newell[axis] += c[axis];
  }
  for (double& value : newell) value *= 0.5;
  if (size == 3) {
    write_fan(ring, 0);
    push_plane(ring[0], ring[1], ring[2], polygon, area_of(newell));
    return;
  }
  const Spread spread = spread_corners(x, y, z, size, stop);
  const Vector base = corner(spread.i), end = corner(spread.j), far = corner(spread.far);
  const Vector normal = crossed({end[0] - base[0], end[1] - base[1], end[2] - base[2]},
                                {far[0] - base[0], far[1] - base[1], far[2] - base[2]});
  const double width = length(normal);
  double height = 0.0;
  for (Index k = 0; k < size; ++k) {
    height = std::max(height, std::abs(dot(normal, {x[k] - base[0], y[k] - base[1], z[k] - base[2]})));
  }
  // A flat loop whose areas cancel (a bow tie) has no side of its own: its triangles decide.
  const bool is_sideless = width > 0.0 && length(newell) <= 1e-12 * width;
  const bool is_planar = height <= rtol * std::sqrt(spread.best) * width && !is_sideless;
  const Index first = n_triangles_, plane = plane_facets.size();
  const bool is_fan = cut_into_fan(ring, newell);
  if (is_planar) {
    const bool is_turned = dot(normal, newell) < 0.0;
    push_plane(ring[is_turned ? spread.j : spread.i], ring[is_turned ? spread.i : spread.j], ring[spread.far], polygon,
               area_of(newell));
  } else {
    nonplanar.push(polygon);
    for (Index row = first; row < n_triangles_; ++row) {
      const Index* t = triangles.data() + 3 * row;
      push_plane(t[0], t[1], t[2], polygon, -1.0);
    }
  }
  if (!is_fan) unfanned.push_back({polygon, 0, first, is_planar ? -1 : plane, newell});
}

void PolygonCuts::load(Indices ring) {
  const Index size = ring.size();
  if (static_cast<Index>(x_.size()) < 2 * size) {
    for (auto* values : {&x_, &y_, &z_}) values->resize(2 * size);
  }
  const double* o = points_[ring[0]];
  const double ox = scaled_(o[0]), oy = scaled_(o[1]), oz = scaled_(o[2]);
  for (Index k = 0; k < size; ++k) {
    const double* p = points_[ring[k]];
    x_[k] = x_[size + k] = scaled_(p[0]) - ox;
    y_[k] = y_[size + k] = scaled_(p[1]) - oy;
    z_[k] = z_[size + k] = scaled_(p[2]) - oz;
  }
}

// A fan of the first or the second corner where all its triangles face the polygon's way; else that of the first, and
// false. Of four corners these are both diagonals: there is nothing else to try.
bool PolygonCuts::cut_into_fan(Indices ring, const Vector& newell) {
  const Index size = ring.size();
  const double floor = 1e-14 * dot(newell, newell);
  for (Index apex = 0; apex < 2; ++apex) {
    const auto arm = [&](Index k) { return Vector{x_[k] - x_[apex], y_[k] - y_[apex], z_[k] - z_[apex]}; };
    bool is_clear = true;
    for (Index k = apex + 1; k < apex + size - 1 && is_clear; ++k) {
      is_clear = dot(crossed(arm(k), arm(k + 1)), newell) > floor;
    }
    if (is_clear) {
      write_fan(ring, apex);
      return true;
    }
  }
  write_fan(ring, 0);
  return size == 4;
}

void PolygonCuts::write_fan(Indices ring, Index apex) {
  const Index size = ring.size();
  for (Index k = apex + 1; k < apex + size - 1; ++k) {
    Index* t = triangles.data() + 3 * n_triangles_++;
    t[0] = ring[apex];
    t[1] = ring[k];
    t[2] = ring[k + 1 < size ? k + 1 : 0];
  }
}

void PolygonCuts::push_plane(Index a, Index b, Index c, Index facet, double area) {
  for (const Index vertex : {a, b, c}) plane_corners.push(vertex);
  plane_facets.push(facet);
  plane_areas.push(area);
}

double PolygonCuts::area_of(const Vector& newell) const { return std::ldexp(length(newell), 2 * exponent_); }

// The triangles are scaled by their own largest coordinate once more: beside larger ones their areas might vanish.
void fill_triangle_areas(Points points, Triangles corners, int exponent, Span<double> areas, Stop& stop) {
  const Scaling scaled(exponent);
  double most = 0.0;
  for (Index i = 0; i < corners.size(); ++i) {
    stop.poll(1);
    if (areas[i] >= 0.0) continue;
    for (int k = 0; k < 3; ++k) {
      const double* p = points[corners(i, k)];
      for (int axis = 0; axis < 3; ++axis) most = std::max(most, std::abs(scaled(p[axis])));
    }
  }
  int own = 0;
  std::frexp(most, &own);
  const Scaling again(own);
  for (Index i = 0; i < corners.size(); ++i) {
    stop.poll(1);
    if (areas[i] >= 0.0) continue;
    Vector u, v;
    const double *a = points[corners(i, 0)], *b = points[corners(i, 1)], *c = points[corners(i, 2)];
    for (int axis = 0; axis < 3; ++axis) {
      const double from = again(scaled(a[axis]));
      u[axis] = again(scaled(b[axis])) - from;
      v[axis] = again(scaled(c[axis])) - from;
    }
    areas[i] = std::ldexp(std::ldexp(0.5 * length(crossed(u, v)), 2 * own), 2 * exponent);
  }
}

}  // namespace voxkernel
