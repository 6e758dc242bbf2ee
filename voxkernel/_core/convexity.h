// Whether a closed triangle surface is locally convex at every edge, decided exactly.
#pragma once

#include "spans.h"
#include "stop.h"

namespace voxkernel {

std::vector<Index> halfedge_twins(Triangles faces, Index n_vertices, Stop& stop);
int edge_convexity(Points vertices, Triangles faces, Indices twins, Indices face_planes, Triangles plane_corners,
                   Stop& stop);

}  // namespace voxkernel
