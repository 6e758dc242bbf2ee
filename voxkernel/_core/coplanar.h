// Groups of exactly coplanar half-spaces.
#pragma once

#include "spans.h"
#include "stop.h"

namespace voxkernel {

// Where half-spaces come from: row i of `corners` names three vertices, or (-1 - j, 0, 0) for row j of
// `explicit_planes`.
struct InputPlanes {
  Points vertices;
  Triangles corners;
  Rows<const double, 4> explicit_planes;  // n, d as given
  bool is_cone = false;                   // the planes through vertices were moved to the origin, the given ones not
};

std::vector<Index> coplanar_groups(Points normals, const InputPlanes& sources, int threads, Stop& stop);
// Of some half-spaces, given by ascending rows, the first on each plane.
std::vector<Index> first_of_planes(Points normals, const InputPlanes& sources, Indices rows, int threads, Stop& stop);

}  // namespace voxkernel
