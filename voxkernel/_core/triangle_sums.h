// Areas of triangles, and moments of surfaces.
#pragma once

#include <array>

#include "spans.h"
#include "stop.h"

namespace voxkernel {

// Of triangles counted from a point in a unit, weighted by areas in the square of it.
struct TriangleMoments {
  double area = 0.0;
  std::array<double, 3> first{};    // of their middles, as all but `corners`
  std::array<double, 6> second{};   // xx, xy, xz, yy, yz, zz
  std::array<double, 10> third{};   // xxx, xxy, xxz, xyy, xyz, xzz, yyy, yyz, yzz, zzz
  std::array<double, 6> corners{};  // second moments of their corners, each with the area of its triangle
};

// Coordinates are taken times 2^-exponent, so that no product overflows: areas in units of 4^exponent.
void triangle_areas(Points vertices, Triangles triangles, int exponent, Span<double> areas, Stop& stop);

// Sums of blocks of one size, one after the other. `unit` is a power of two, near the extent.
TriangleMoments triangle_moments(Points vertices, Triangles triangles, const std::array<double, 3>& base, double unit,
                                 Stop& stop);

}  // namespace voxkernel
