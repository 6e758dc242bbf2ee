// Facet planes in local coordinates, each with a bound on its rounding error, and what a mesh must be for them.
#pragma once

#include "spans.h"
#include "stop.h"

namespace voxkernel {

struct Box {
  double low[3];
  double high[3];
  double smallest;  // the smallest magnitude but zero
};

Index facet_planes(Points vertices, Triangles corners, const double* origin, double inverse_scale,
                   Rows<double, 3> normals, Span<double> offsets, Span<double> areas, Span<double> errors, Stop& stop);
Box coordinate_range(Points vertices, Triangles faces, Stop& stop);
bool boundary_is_zero(Triangles faces, Index n_vertices, int threads, Stop& stop);

}  // namespace voxkernel
