// The border of a triangle surface as simple loops of vertices.
#pragma once

#include <cstdint>

#include "growing_array.h"
#include "spans.h"
#include "stop.h"

namespace voxkernel {

template <typename Id>
struct Loops {
  GrowingArray<Id> vertices;
  GrowingArray<Id> starts;  // of every loop in `vertices`, and the end
};

// Whether 32 bits hold every number of a border.
bool is_small_border(Index n_vertices, Indices border);

// Half-edge 3 f + k runs from corner k of triangle f to the next; `border` names those without another. A loop follows
// them, against one only where none goes on forward; a chain that ends is given as it is. Id is of 32 bits where these
// hold all numbers, or of 64.
template <typename Id>
void find_boundary_loops(Triangles faces, Index n_vertices, Indices border, Loops<Id>& loops, Stop& stop);

extern template void find_boundary_loops(Triangles, Index, Indices, Loops<std::int32_t>&, Stop&);
extern template void find_boundary_loops(Triangles, Index, Indices, Loops<std::int64_t>&, Stop&);

}  // namespace voxkernel
