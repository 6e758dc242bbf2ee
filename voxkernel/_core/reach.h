// Which half-spaces the corners of a convex polyhedron come near or pass: the proof that the others cannot matter.
#pragma once

#include <vector>

#include "spans.h"
#include "stop.h"

namespace voxkernel {

// The corners of a polyhedron in a tree of boxes, for the largest n . v over all of them.
class CornerTree {
 public:
  explicit CornerTree(Points corners);

  // The largest n . v where it is above `floor`; else a number that is not above `floor`.
  double largest(const double* normal, double floor) const;

 private:
  struct Node {
    double low[3], high[3];
    Index first, last;  // corners in leaves
    Index skip;         // the node to go on with when nothing here counts
    bool is_leaf;
  };
  void build(Index first, Index last);

  std::vector<double> corners_;
  std::vector<Node> nodes_;
};

struct Reach {
  std::vector<Index> rows;
  std::vector<double> excess;  // the largest n . v - slack over the corners
  std::vector<double> pads;    // what rounding may add to that
};
Reach planes_reaching(Points normals, Doubles offsets, Doubles errors, const double* center, Points corners,
                      double margin, Stop& stop);

}  // namespace voxkernel
