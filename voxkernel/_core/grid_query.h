// Which voxels of a list are active in a sparse grid, asked of a table of its blocks or of its sorted runs.
#pragma once

#include <array>

#include "spans.h"
#include "stop.h"

namespace voxkernel {

// Mask of every 8^3 block in a box: `row` points into `words`, eight of which belong to a block.
struct BlockTable {
  std::array<Index, 3> low;
  std::array<Index, 3> shape;
  Span<const std::int32_t> row;
  Span<const std::uint64_t> words;
};

// Runs of Morton codes, sorted; `row` is a leaf's row in `masks` or negative for a tile.
struct MortonRuns {
  Index reach;
  Indices code, last, row;
  Rows<const std::uint64_t, 8> masks;
};

template <typename Voxel>
void voxels_in_table(Rows<const Voxel, 3> voxels, const BlockTable& table, Span<bool> active, Stop& stop);
template <typename Voxel>
void voxels_in_runs(Rows<const Voxel, 3> voxels, const MortonRuns& runs, Span<bool> active, Stop& stop);
// World points: their voxels are found by an origin and a 3x3 matrix.
void points_in_table(Points points, const double* origin, Points to_cells, const BlockTable& table, Span<bool> active,
                     Stop& stop);
void points_in_runs(Points points, const double* origin, Points to_cells, const MortonRuns& runs, Span<bool> active,
                    Stop& stop);

}  // namespace voxkernel
