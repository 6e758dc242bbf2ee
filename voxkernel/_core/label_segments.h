// The voxels that a segment between two voxel centres touches, in integers.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <memory>
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
  bool advance() { return step() != 0; }
  // The axes of the next step, as bits; 0 at the end.
  unsigned step() {
    if (left_ == 0) return 0;
    const Index first = std::min(next_[0], std::min(next_[1], next_[2]));
    unsigned axes = 0;
    if (next_[0] == first) axes |= move<0>();
    if (next_[1] == first) axes |= move<1>();
    if (next_[2] == first) axes |= move<2>();
    return axes;
  }
  Index at() const { return at_; }

 private:
  template <int axis>
  unsigned move() {
    at_ += step_[axis];
    next_[axis] += gap_[axis];
    --left_;
    return 1u << axis;
  }

  Index at_, left_ = 0;
  Index step_[3], next_[3], gap_[3];
};

// The steps of segments, by falling numbers of voxels n along the axes, each found when it is asked for first: a set of
// axes a step, as bits, the axis with the largest n first.
class KeptSteps {
 public:
  static constexpr int kEnds = 4;

  // For segments in a box with edges of so many voxels, the longest first.
  explicit KeptSteps(const Index* edges);

  // Ended by kEnds times 0; until the next call.
  const std::uint8_t* find(const Index* n) {
    std::int32_t& first = first_[places_[0][n[0]] + places_[1][n[1]] + n[2]];
    if (first < 0) first = append(n);
    return steps_.data() + first;
  }

 private:
  std::int32_t append(const Index* n);

  std::vector<std::int32_t> first_;      // of every n
  std::vector<std::int32_t> places_[2];  // where those with a largest n start, and those with a second one among them
  std::vector<std::uint8_t> steps_;
};

// The steps of segments between voxels of a box, kept: walking them again is five times faster than finding them. A
// segment of n voxels along the axes has the steps of its mirror images, and of those with the axes in another order.
// What is kept for a small box serves all small boxes of a thread, in which it has to be used.
class SegmentSteps {
 public:
  static constexpr int kEnds = KeptSteps::kEnds;

  SegmentSteps() = default;
  SegmentSteps(const Index* shape, const Index* strides);

  // Whether the box is small enough for this.
  bool is_kept() const { return kept_ != nullptr; }
  struct Found {
    const std::uint8_t* steps;  // ended by kEnds times 0
    const Index* moves;         // by how much each changes the position
  };
  // The steps from a voxel by `d`.
  Found find(const Index* d) {
    const Index n[3] = {d[0] < 0 ? -d[0] : d[0], d[1] < 0 ? -d[1] : d[1], d[2] < 0 ? -d[2] : d[2]};
    const unsigned order = (n[0] < n[1] ? 1u : 0u) | (n[1] < n[2] ? 2u : 0u) | (n[0] < n[2] ? 4u : 0u);
    const unsigned signs = (d[0] < 0 ? 1u : 0u) | (d[1] < 0 ? 2u : 0u) | (d[2] < 0 ? 4u : 0u);
    const std::uint8_t* axes = kOrders[order];
    const Index sorted[3] = {n[axes[0]], n[axes[1]], n[axes[2]]};
    return {kept_->find(sorted), moves_[order][signs]};
  }

 private:
  // Axes by falling n, for n0 < n1, n1 < n2 and n0 < n2 as bits; two of the eight cannot be.
  static constexpr std::uint8_t kOrders[8][3] = {{0, 1, 2}, {1, 0, 2}, {0, 2, 1}, {0, 1, 2},
                                                 {0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {2, 1, 0}};

  Index moves_[8][8][8];
  std::unique_ptr<KeptSteps> own_;
  KeptSteps* kept_ = nullptr;
};

// Positions of all voxels that a segment touches, both ends included.
std::vector<Index> touched_voxels(const Index* from, const Index* to);

}  // namespace voxkernel
