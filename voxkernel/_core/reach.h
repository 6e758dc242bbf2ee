// Which half-spaces the corners of a convex polyhedron come near or pass: the proof that the others cannot matter.
#pragma once

#include <cstdint>
#include <vector>

#include "spans.h"
#include "stop.h"
#include "unfilled.h"

namespace voxkernel {

// The corners of a polyhedron in a tree of boxes, for the largest n . v over all of them.
class CornerTree {
 public:
  CornerTree(Points corners, int threads, Stop& stop);

  // Whether n . v is above `floor` for a corner v.
  bool reaches(const double* normal, double floor) const;

 private:
  struct Node {
    float low[3], high[3];     // rounded outwards
    std::int32_t first, last;  // corners in leaves
    std::int32_t skip;         // the node to go on with when nothing here counts; the next one behind a leaf
  };
  void build(Index first, Index last, std::vector<Node>& nodes, int threads, Stop& stop);

  std::vector<double> corners_;
  std::vector<Node> nodes_;
};

// Rows of the planes that a corner reaches; of `among`, where that is not empty, only those where it is true.
UnfilledVector<Index> planes_reaching(Points normals, Doubles offsets, Doubles errors, const double* center,
                                      Points corners, double margin, Span<const bool> among, int threads, Stop& stop);

}  // namespace voxkernel
