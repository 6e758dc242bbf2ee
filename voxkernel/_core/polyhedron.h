// Faces, volume and moments of a convex polyhedron from the triangles of its dual hull.
#pragma once

#include <vector>

#include "spans.h"
#include "stop.h"

namespace voxkernel {

struct Turns {
  std::vector<char> alike;
  bool all_reached;
};
Turns consistent_turns(Triangles simplices, Triangles neighbours_of, Index first, Stop& stop);

struct Rings {
  std::vector<Index> start;
  std::vector<Index> ring;
  bool all_closed;
};
Rings dual_faces(Triangles simplices, Span<const bool> outward, Indices vertex_ids, Index n_duals, Stop& stop);

struct Moments {
  double volume = 0.0;
  double first[3] = {0.0, 0.0, 0.0};
  double second[3][3] = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  double area = 0.0;
};
Moments moments(Points vertices, Indices start, Indices ring, Stop& stop);
double solid_angle(Points vertices, Indices ring, Stop& stop);

}  // namespace voxkernel
