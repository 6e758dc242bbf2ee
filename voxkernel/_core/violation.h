// What points violate, every sign exact or handed back.
#pragma once

#include <vector>

#include "spans.h"
#include "stop.h"

namespace voxkernel {

// Facet planes in local coordinates; errors[i] bounds the error of n . x - d over |x| + 1. `corners` are rows of
// `vertices`, or negative where a plane has none.
struct FacetPlanes {
  Points normals;
  Doubles offsets, errors;
  Indices weights;
  Triangles corners;
  Points vertices;
};

// `local` holds x, y and z of the points one after the other, `world` the same points as given.
struct PointSet {
  Doubles local[3];
  Points world;
};

std::vector<Index> violated_weights(const PointSet& points, const FacetPlanes& planes, bool by_expansions,
                                    Span<Index> order, Span<Index> sums, Stop& stop);
void faces_away(Points vertices, Triangles faces, const double* point, Span<bool> away, Stop& stop);

}  // namespace voxkernel
