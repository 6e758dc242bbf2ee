// What no voxel of a block can see, told from a coarser image: a bound on the best view of every block.
#pragma once

#include <vector>

#include "label_crop.h"
#include "spans.h"
#include "stop.h"

namespace voxkernel {

struct LabelBlocks {
  Index edge = 1;                       // voxels
  std::vector<Index> of_voxel;          // block of each voxel of a list
  std::vector<Index> hidden;            // at least so many voxels are hidden from every voxel of a block
  std::vector<std::uint8_t> is_hidden;  // one row a block: 1 for the blocks that are wholly hidden from it
  Index size() const { return static_cast<Index>(hidden.size()); }
};

// `voxels` are those of the object. A block stops to be looked at when more than `enough` voxels are hidden from it.
LabelBlocks bound_blocks(const Crop& crop, Indices voxels, Index edge, Index enough, Stop& stop, Index& n_steps);

}  // namespace voxkernel
