// Facet planes in local coordinates, each with a bound on its rounding error, and what a mesh must be for them.
#pragma once

#include <vector>

#include "spans.h"
#include "stop.h"
#include "unfilled.h"

namespace voxkernel {

struct Box {
  double low[3];
  double high[3];
  double smallest;  // the smallest magnitude but zero
};

// The local frame of a surface: corners have length at most 1 in (x - origin) / scale.
struct PlaneFrame {
  double origin[3];  // the middle of the box
  double scale;      // a power of two
  double span[3];    // of the box
  double largest;    // magnitude of a coordinate
  double smallest;   // the smallest magnitude but zero
};

// The planes of a mesh, errors as of `facet_planes`; areas are those of the world.
struct MeshPlanes {
  PlaneFrame frame;
  UnfilledVector<double> normals, offsets, areas, errors;
  Index undecided = 0;         // left to exact arithmetic
  Index refused = 0;           // those, and those without area
  bool bounds_volume = false;  // whether every edge of `faces` is traversed equally often in both directions
};

// `faces` are the triangles of the surface, `corners` three corners of each of its planes.
MeshPlanes mesh_planes(Points vertices, Triangles faces, Triangles corners, int threads, Stop& stop);

Index facet_planes(Points vertices, Triangles corners, const double* origin, double inverse_scale,
                   Rows<double, 3> normals, Span<double> offsets, Span<double> areas, Span<double> errors, Stop& stop);
Box coordinate_range(Points vertices, Triangles faces, int threads, Stop& stop);
PlaneFrame plane_frame(Points vertices, Triangles faces, Stop& stop);
// A lower bound of the mean square of unit normals along any direction, of every `step`-th, up to rounding.
double least_spread(Points normals, Index step, Stop& stop);
bool boundary_is_zero(Triangles faces, Index n_vertices, int threads, Stop& stop);

}  // namespace voxkernel
