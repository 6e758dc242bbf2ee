#include "common_point.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace voxkernel {
namespace {

constexpr double kUnit = 0x1p-53;
constexpr double kLong = 0x1p-102;   // of one sum or product, double_double.h
constexpr double kGood = 0x1p-56;    // beside the rounding of the result nothing else may count
constexpr double kLost = 0x1p-1000;  // more than what underflow can cost: numbers are made to be near 1

using Vector = std::array<DoubleDouble, 3>;

double size_of(const Vector& v) { return std::abs(v[0].high) + std::abs(v[1].high) + std::abs(v[2].high); }

// Each number is off by less than 4 of `kLong` of the product of 1-norms.
Vector cross(const Vector& u, const Vector& v) {
  return {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]};
}

}  // namespace

const CommonPoints::Plane& CommonPoints::plane(Index place) {
  Plane& found = cache_[static_cast<std::size_t>(place) & (cache_.size() - 1)];
  if (found.place == place) return found;
  found.place = place;
  const Index* corners = source_.corners[rows_[place]];
  if (corners[0] < 0) {
    from_given(source_.given[-1 - corners[0]], found);
  } else {
    from_corners(corners, found);
  }
  return found;
}

// n = (b - a) x (c - a), s = n . (a - centre), over the lengths of both edges. Differences of two doubles are exact.
void CommonPoints::from_corners(const Index* corners, Plane& plane) const {
  const double *a = source_.vertices[corners[0]], *b = source_.vertices[corners[1]], *c = source_.vertices[corners[2]];
  Vector u, v, x;
  double x_error = kLost;
  for (int k = 0; k < 3; ++k) {
    const HighLow first = two_sum(b[k], -a[k]), second = two_sum(c[k], -a[k]);
    u[k] = {first.high, first.low};
    v[k] = {second.high, second.low};
    x[k] = {to_unit_(a[k]), 0.0};
    double sizes = std::abs(x[k].high);
    for (Index t = 0; t < source_.center.size(); ++t) {
      const double center = to_unit_(source_.center(t, k));
      x[k] = x[k] - DoubleDouble{center, 0.0};
      sizes += std::abs(center);
      x_error += 2.0 * kLong * sizes;
    }
  }
  const Shift of_u(-exponent_of(size_of(u))), of_v(-exponent_of(size_of(v)));
  for (int k = 0; k < 3; ++k) {
    u[k] = of_u(u[k]);
    v[k] = of_v(v[k]);
  }
  const Vector n = cross(u, v);
  plane.s = n[0] * x[0] + n[1] * x[1] + n[2] * x[2];
  for (int k = 0; k < 3; ++k) plane.n[k] = n[k];
  plane.n_size = size_of(n);
  plane.n_error = 8.0 * kLong * size_of(u) * size_of(v) + kLost;
  plane.s_error =
      plane.n_size * x_error + 3.0 * plane.n_error * size_of(x) + 8.0 * kLong * plane.n_size * size_of(x) + kLost;
}

void CommonPoints::from_given(const double* row, Plane& plane) const {
  const int exponent = exponent_of(std::max({std::abs(row[0]), std::abs(row[1]), std::abs(row[2])}));
  const Shift of_n(-exponent);
  // At once: in between it could be too small.
  plane.s = {row[3] == 0.0 ? 0.0 : Shift(-exponent - exponent_)(row[3]), 0.0};
  plane.n_size = 0.0;
  double sizes = std::abs(plane.s.high);
  plane.n_error = plane.s_error = kLost;
  for (int k = 0; k < 3; ++k) {
    plane.n[k] = {of_n(row[k]), 0.0};
    plane.n_size += std::abs(plane.n[k].high);
    for (Index t = 0; t < source_.center.size(); ++t) {
      const double center = to_unit_(source_.center(t, k));
      plane.s = plane.s - plane.n[k] * DoubleDouble{center, 0.0};
      sizes += std::abs(plane.n[k].high * center);
      plane.s_error += 4.0 * kLong * sizes;
    }
  }
}

// Cramer's rule. Planes that are off move their common point by less than what they are off by there, times the sum of
// the cross products of normals over the determinant; that and the rounding of the rule itself, half as much again for
// what is of second order.
double CommonPoints::find(Index i, Index j, Index k, double* point) {
  const Plane planes[3] = {plane(i), plane(j), plane(k)};
  Vector top{};
  DoubleDouble below{};
  double top_error = kLost, spread[3];
  for (int r = 0; r < 3; ++r) {
    const Plane &a = planes[(r + 1) % 3], &b = planes[(r + 2) % 3], &c = planes[r];
    const Vector normals = cross({a.n[0], a.n[1], a.n[2]}, {b.n[0], b.n[1], b.n[2]});
    for (int m = 0; m < 3; ++m) top[m] = top[m] + c.s * normals[m];
    if (r == 0) below = normals[0] * c.n[0] + normals[1] * c.n[1] + normals[2] * c.n[2];
    top_error += 16.0 * kLong * std::abs(c.s.high) * a.n_size * b.n_size;
    spread[r] = size_of(normals) + 8.0 * kLong * a.n_size * b.n_size + kLost;
  }
  const double determinant = std::abs(below.high);
  double below_error = 16.0 * kLong * planes[0].n_size * planes[1].n_size * planes[2].n_size + kLost;
  for (int r = 0; r < 3; ++r) below_error += 3.0 * planes[r].n_error * spread[r];
  const double size = size_of(top) / determinant;
  double moved = top_error + below_error * size;
  for (int r = 0; r < 3; ++r) moved += spread[r] * (planes[r].s_error + 3.0 * planes[r].n_error * size);
  const double bound = 1.5 * moved / determinant;
  if (!(determinant > 8.0 * below_error) || !(bound <= kGood * size)) return std::numeric_limits<double>::infinity();
  for (int m = 0; m < 3; ++m) point[m] = top[m].high / below.high;
  return bound + 3.0 * kUnit * size;
}

}  // namespace voxkernel
