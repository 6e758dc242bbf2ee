// What planes violate in the open cells of an octree, for surfaces whose planes come in chunks: sums of integers, to
// which every chunk adds its part.
#pragma once

#include "relaxed.h"
#include "spans.h"
#include "stop.h"

namespace voxkernel {

// Cells of one level, ascending by their codes: three bits a level, x before y before z.
struct OpenCells {
  int level;
  Indices codes;
};

// How many cells there are from one down to `below` levels below it.
inline Index n_cells_down(int below) { return ((Index{1} << (3 * (below + 1))) - 1) / 7; }

// Adds to `sums`, pairs (certain, possible), what the planes violate of every open cell and of its descendants down to
// `below` levels below: cell after cell, in each level after level, in each by their codes. Unless `bricks` is empty,
// the descendants of the last level are bricks of 8^3 voxels; for each of them 512 certain sums and 512 possible ones
// are added there, in the order of BrickSums.
void add_open_weights(const CellPlanes& planes, const OpenCells& open, int below, Span<Index> sums, Span<Index> bricks,
                      Stop& stop);

}  // namespace voxkernel
