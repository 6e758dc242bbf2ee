// The polytope of half-spaces around a point strictly inside all of them, exact to the last face.
#pragma once

#include <cstdint>
#include <vector>

#include "dual_points.h"
#include "spans.h"
#include "stop.h"
#include "unfilled.h"

namespace voxkernel {

// Faces in the order of their rows, vertices by first appearance, each polygon counter-clockwise from outside and
// beginning at its first vertex in the order of `vertex_rows`: nothing depends on the order of the work.
struct HullPolytope {
  bool is_inside = true;            // whether the centre lies strictly inside every half-space
  bool is_closed = true;            // whether no side of the cube is left; nothing below is filled in where one is
  UnfilledVector<double> vertices;  // (k, 3) from the centre, local units
  UnfilledVector<std::int32_t> vertex_rows;  // (k, 3) ascending: three faces that meet there in one point
  double vertex_error = 0.0;                 // no coordinate of a vertex is farther from the exact one
  std::vector<Index> start;
  UnfilledVector<std::int32_t> ring;
  std::vector<std::int32_t> rows;  // of each face: the first of those on its plane
};

// The rows are given away: they are not held while the hull grows.
HullPolytope dual_hull(const LocalPlanes& planes, const PlaneSource& source, std::vector<Index>&& rows,
                       int cube_exponent, int threads, Stop& stop);

}  // namespace voxkernel
