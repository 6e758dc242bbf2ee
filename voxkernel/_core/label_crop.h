// One object of a label image: its voxels in a box, one byte each, with a layer of background around.
#pragma once

#include <cstdint>
#include <cstring>

#include "spans.h"

namespace voxkernel {

using Bytes = Span<const std::uint8_t>;

// Axes are those of the array: voxel (i, j, k) is bytes[(i * shape[1] + j) * shape[2] + k]. The outermost layer is
// background, so that a walk that leaves the object stops before it leaves the array. A flat crop is an image of two
// axes: one layer of voxels between two of background, and nothing is done along the first axis.
struct Crop {
  Bytes bytes;
  Index shape[3];
  bool is_flat;

  Index stride(int axis) const { return axis == 2 ? 1 : axis == 1 ? shape[2] : shape[1] * shape[2]; }
  Index size() const { return shape[0] * shape[1] * shape[2]; }
  Index flat(Index i, Index j, Index k) const { return (i * shape[1] + j) * shape[2] + k; }
  void position(Index voxel, Index* ijk) const {
    ijk[2] = voxel % shape[2];
    const Index row = voxel / shape[2];
    ijk[1] = row % shape[1];
    ijk[0] = row / shape[1];
  }
};

// The next voxel of the object in a row of n, from one on; n where there is none.
inline Index next_voxel(const std::uint8_t* row, Index from, Index n) {
  constexpr Index kAtOnce = 8;
  while (from < n && row[from] == 0) {
    std::uint64_t eight = 0;
    if (from + kAtOnce <= n) std::memcpy(&eight, row + from, sizeof eight);
    from += from + kAtOnce <= n && eight == 0 ? kAtOnce : 1;
  }
  return from;
}

}  // namespace voxkernel
