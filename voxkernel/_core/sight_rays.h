// Rays and nearest points in a tree of triangles, in double precision: for samples, never for proofs.
#pragma once

#include "sight_tree.h"

namespace voxkernel {

// Sets bit j % 64 of word (i, j / 64) where point i is on the inner side of the triangle of spot j and no other
// triangle is on the way. `words` has `n_words` for each point.
void points_see(const SightTree& tree, Points points, Points spots, Indices spot_faces, Span<std::uint64_t> words,
                Stop& stop);
// Whether point i sees spot i.
void pairs_see(const SightTree& tree, Points points, Points spots, Indices spot_faces, Span<bool> seen, Stop& stop);
// A triangle on the way from a point to a spot of a facet that it is on the inner side of, -1 where there is none.
// `guess` is looked at first, unless it is -1.
Index triangle_between(const SightTree& tree, const double* point, const double* spot, Index face, Index guess);
// Distance in lengths of the direction to the first triangle that is not `skip`, infinite where there is none.
void first_hits(const SightTree& tree, Points starts, Points directions, Indices skip, Span<double> at, Stop& stop);
// How often the surface goes around each point: crossings of a ray, counted with their sign.
void winding_numbers(const SightTree& tree, Points points, Span<Index> windings, Stop& stop);
// The nearest point of the triangles, and its distance.
void nearest_points(const SightTree& tree, Points points, Rows<double, 3> nearest, Span<double> distances, Stop& stop);

}  // namespace voxkernel
