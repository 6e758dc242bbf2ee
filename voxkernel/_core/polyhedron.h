// Volume and moments of a convex polyhedron, and how well its corners lie on the planes of its faces.
#pragma once

#include "spans.h"
#include "stop.h"

namespace voxkernel {

struct Moments {
  double volume = 0.0;
  double first[3] = {0.0, 0.0, 0.0};
  double second[3][3] = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  double area = 0.0;
};
Moments moments(Points vertices, Indices start, Indices ring, Stop& stop);
// How far the corners of faces lie from the planes of their rows, relative to a centre, and a bound on the rounding of
// that; and how far the farthest corner is from the centre.
struct Misfit {
  double on_face = 0.0;
  double blur = 0.0;
  double extent = 0.0;
};
Misfit face_misfit(Points normals, Doubles offsets, Doubles errors, const double* center, Points vertices,
                   Indices start, Indices ring, Indices rows);
double solid_angle(Points vertices, Indices ring, Stop& stop);

}  // namespace voxkernel
