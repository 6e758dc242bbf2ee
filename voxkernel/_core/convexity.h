// Whether a closed triangle surface is locally convex at every edge, decided exactly.
#pragma once

#include <cstdint>

#include "spans.h"
#include "stop.h"
#include "unfilled.h"

namespace voxkernel {

int edge_convexity(Points vertices, Triangles faces, Indices face_planes, Triangles plane_corners, int least,
                   int threads, Stop& stop);

// Vertices in use as (vertex - origin) / scale - point, and corners of faces as numbers of them.
struct UsedVertices {
  UnfilledVector<double> vertices;
  UnfilledVector<std::int32_t> ring;
};
UsedVertices used_vertices(Points vertices, Triangles faces, const double* origin, double scale, const double* point,
                           int threads, Stop& stop);

// The first, a middle and the last triangle at each of `n` vertices, all of which are in use: of a strictly convex
// surface, no two in one plane. Three rows a vertex.
UnfilledVector<std::int32_t> triangles_at_vertices(SmallIndices ring, Index n, int threads, Stop& stop);

}  // namespace voxkernel
