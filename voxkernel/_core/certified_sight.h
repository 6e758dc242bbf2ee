// Which facets a point sees as a whole, decided exactly: nothing enters the hull of the point and the facet.
#pragma once

#include <vector>

#include "sight_tree.h"

namespace voxkernel {

// Parts of facets that are seen by certificate. Part i is the triangle whose corners are, over 2**depths[i], the
// weights[9 i + 3 c + k] of corner k of the facet in corner c of the part.
struct CertifiedParts {
  std::vector<Index> faces;
  std::vector<Index> points;
  std::vector<Index> depths;
  std::vector<Index> weights;
  std::vector<double> corners;  // 9 a part, rounded; corners on an edge are the same from both of its sides
};

// Assigns each facet of `faces` to a point that sees all of it; tries those of `order` (one row a facet) from first to
// last. A facet that none of them sees as a whole is cut 1:4, up to the number of times given for it; parts in the dark
// are not cut further.
CertifiedParts certify_sight(const SightTree& tree, Points points, Indices faces, Span<const Index> order,
                             Span<const Index> max_depths, Stop& stop);

}  // namespace voxkernel
