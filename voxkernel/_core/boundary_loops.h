// The border of a triangle surface as simple loops of vertices.
#pragma once

#include <vector>

#include "spans.h"
#include "stop.h"

namespace voxkernel {

struct Loops {
  std::vector<Index> vertices;
  std::vector<Index> starts;  // of every loop in `vertices`, and the end
};

// Half-edge 3 f + k runs from corner k of triangle f to the next; `border` names those without another. A loop follows
// them, against one only where none goes on forward; a chain that ends is given as it is.
Loops boundary_loops(Triangles faces, Index n_vertices, Indices border, Stop& stop);

}  // namespace voxkernel
