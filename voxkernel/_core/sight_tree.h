// Triangles in a tree of boxes, for everything that asks what is in between.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "spans.h"
#include "stop.h"

namespace voxkernel {

struct Box {
  double low[3], high[3];
};

// Owns a copy of the corners. Boxes are exact: lowest and highest coordinates of the triangles below.
class SightTree {
 public:
  static constexpr int kLeaf = 4;
  struct Node {
    Box box;
    std::int32_t first;  // of a leaf: its first entry of `order`; else the left child, the right one follows it
    std::int32_t count;  // 0: not a leaf
  };

  SightTree(Points vertices, Triangles faces, Stop& stop);

  Index size() const { return static_cast<Index>(order_.size()); }
  // Three corners, one behind the other.
  const double* corners(Index face) const { return corners_.data() + 9 * face; }
  const std::vector<Node>& nodes() const { return nodes_; }
  const std::vector<std::int32_t>& order() const { return order_; }

 private:
  void build(const std::vector<Box>& boxes, Stop& stop);

  std::vector<double> corners_;
  std::vector<Node> nodes_;
  std::vector<std::int32_t> order_;
};

// A stack for walks: the tree is split in the middle, so it is never deeper than 40.
struct NodeStack {
  std::int32_t ids[96];
  int size = 0;
  void push(std::int32_t id) { ids[size++] = id; }
  std::int32_t pop() { return ids[--size]; }
};

}  // namespace voxkernel
