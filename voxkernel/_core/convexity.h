// Whether a closed triangle surface is locally convex at every edge, decided exactly.
#pragma once

#include "spans.h"
#include "stop.h"

namespace voxkernel {

int edge_convexity(Points vertices, Triangles faces, Indices face_planes, Triangles plane_corners, int least,
                   int threads, Stop& stop);

}  // namespace voxkernel
