// A convex polyhedron cut out of a cube by a few half-spaces, in floating point.
#pragma once

#include <vector>

#include "spans.h"
#include "stop.h"

namespace voxkernel {

struct Clipped {
  std::vector<double> vertices;  // xyz of each
  std::vector<Index> start, ring, rows;
  bool is_closed = false;  // no face of the cube is left
  bool is_sound = false;   // something solid is left, and its faces close
};
Clipped clipped_polyhedron(Points normals, Doubles slacks, double reach, Stop& stop);

}  // namespace voxkernel
