// The voxels that a segment between two voxel centres touches, in integers.
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "label_crop.h"
#include "spans.h"

namespace voxkernel {

// Largest number of voxels between two ends along an axis: products of three such numbers and 2 fit in 64 bits.
constexpr Index kLongestSegment = Index{1} << 20;

// Walks along a segment. It touches a voxel when it meets the voxel's open cube: a segment that passes exactly through
// an edge or a corner goes from one cube to the one diagonally across. The k-th crossing along an axis of n voxels is
// at the share (2 k - 1) / (2 n) of the segment; shares are compared as products of integers.
class SegmentWalk {
 public:
  // From a voxel by `d` voxels along the axes; `strides` are those of the array.
  SegmentWalk(Index from, const Index* d, const Index* strides) : at_(from) {
    Index n[3], factor[3];
    for (int a = 0; a < 3; ++a) {
      n[a] = d[a] < 0 ? -d[a] : d[a];
      factor[a] = n[a] == 0 ? 1 : n[a];
      step_[a] = d[a] < 0 ? -strides[a] : strides[a];
      left_ += n[a];
    }
    for (int a = 0; a < 3; ++a) {
      const Index others = factor[(a + 1) % 3] * factor[(a + 2) % 3];
      next_[a] = n[a] == 0 ? std::numeric_limits<Index>::max() : others;
      gap_[a] = 2 * others;
    }
  }

  // Whether the segment goes on; then `at()` is the next voxel.
  bool advance() {
    if (left_ == 0) return false;
    Index first = next_[0] < next_[1] ? next_[0] : next_[1];
    if (next_[2] < first) first = next_[2];
    for (int a = 0; a < 3; ++a) {
      const bool crosses = next_[a] == first;
      at_ += crosses ? step_[a] : 0;
      next_[a] += crosses ? gap_[a] : 0;
      left_ -= crosses ? 1 : 0;
    }
    return true;
  }
  Index at() const { return at_; }

 private:
  Index at_, left_ = 0;
  Index step_[3], next_[3], gap_[3];
};

// Positions of all voxels that a segment touches, both ends included.
std::vector<Index> touched_voxels(const Index* from, const Index* to);

}  // namespace voxkernel
