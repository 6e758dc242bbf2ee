// What the edges of a triangle surface say: its border, orientation, parts and fans.
#pragma once

#include <vector>

#include "spans.h"
#include "stop.h"

namespace voxkernel {

// Half-edge 3 f + k runs from corner k of triangle f to the next. A triangle that names a vertex twice has no edges; it
// joins components only.
struct SurfaceEdges {
  Index n_faces = 0;     // triangles that have edges
  Index n_vertices = 0;  // of these
  Index n_edges = 0;
  Index n_nonmanifold = 0;    // edges of three triangles or more
  std::vector<Index> border;  // half-edges without another, ordered by the smaller and the larger vertex
  bool is_oriented = true;    // as many one way as the other, or one more where their number is odd
  Index n_components = 0;     // parts that share no vertex
  Index n_fans = 0;           // of triangles round vertices, across edges; of one closed and oriented component
  Index n_parts = 0;          // parts that share no edge, where closed and oriented
  std::vector<Index> parts;   // the part of every triangle, -1 of one without edges; as `n_parts`

  bool is_closed() const { return border.empty() && n_nonmanifold == 0; }
};

// `is_wide`: numbers of 64 bits also where 32 would do.
SurfaceEdges surface_edges(Triangles faces, Index n_vertices, bool is_wide, Stop& stop);

}  // namespace voxkernel
