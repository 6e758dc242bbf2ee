// Rays from a centre: directions of vertices, the triangle a ray passes, distances of points from triangles.
#pragma once

#include "spans.h"
#include "stop.h"

namespace voxkernel {

void directions_and_radii(Points vertices, const double* center, Rows<double, 3> directions, Span<double> radii,
                          Stop& stop);
void settle_rays(Points corners, Triangles faces, Triangles across, Points directions, Span<Index> hits, double slack,
                 Index max_steps, Span<double> radii, Stop& stop);
void triangle_distances(Points points, Rows<const double, 9> corners, Span<double> distances, Stop& stop);

}  // namespace voxkernel
