// What the voxels of an 8^3 brick violate of a list of planes, for certain and at most.
#pragma once

#include "plane_list.h"
#include "voxels.h"

namespace voxkernel {

// Entry 64 z + 8 x + y belongs to voxel (x, y, z); the last 64 are what changes beyond the brick.
struct BrickSums {
  alignas(32) Index low[9 * 64];
  alignas(32) Index high[9 * 64];
};

// Fills `sums` for the planes first..last; `certain` is violated everywhere. `half` is half the edge of a voxel.
void fill_sums(const PlaneView& planes, Index first, Index last, double half, Index certain, BrickSums& sums);
// Fills the masks of the voxels that violate at most `most_inside`, and of those that are undecided with respect to it
// and `least_outside`.
Content fill_masks(const BrickSums& sums, Index most_inside, Index least_outside, Word (&inside)[8],
                   Word (&boundary)[8]);

}  // namespace voxkernel
