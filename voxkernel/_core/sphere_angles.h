// Solid angles of triangles and of surfaces with a boundary, and their derivatives.
#pragma once

#include <cstdint>

#include "spans.h"
#include "stop.h"

namespace voxkernel {

struct AngleSums {
  double total;  // of the signed angles
  double size;   // of their sizes
};
struct DensitySums {
  double total;   // of the angles w
  double square;  // of w^2 / a
};

AngleSums triangle_angles(Points vertices, Triangles faces, const double* center, Span<const std::int8_t> side,
                          Span<double> angles, Stop& stop);
double cone_angle(Points starts, Points ends, const double* apex, const double* x, Stop& stop);
void cone_angles(Points starts, Points ends, const double* apex, Points points, Span<double> angles, Stop& stop);
void boundary_field(Points starts, Points ends, const double* x, double* gradient, Rows<double, 3> hessian, Stop& stop);
DensitySums density_moments(Points vertices, Triangles faces, Doubles areas, const double* center, double* first,
                            double* second, Stop& stop);

}  // namespace voxkernel
