// The violation on an octree: its value at voxel centres where it may be small, one value where it is constant.
#pragma once

#include "descent.h"
#include "spans.h"
#include "stop.h"
#include "voxels.h"

namespace voxkernel {

struct ViolationCells {
  Tiles tiles;
  std::vector<float> tile_values;
  std::vector<std::int32_t> leaf_ijk;
  std::vector<Word> leaf_mask;
  std::vector<float> leaf_values;  // 512 a leaf, entry 64 x + 8 y + z
};

ViolationCells violation_cells(const CubePlanes& planes, Index most, double units, int depth, Stop& stop);

}  // namespace voxkernel
