// The relaxed kernel on an octree: the weight that is violated for certain, and the list of undecided planes.
#pragma once

#include "spans.h"
#include "stop.h"
#include "voxels.h"

namespace voxkernel {

// The planes of a cell: rows of `numbers` are normal, reach, value at the centre; the first `n_domain` are a domain's.
struct CellPlanes {
  Rows<const double, 5> numbers;
  Indices weights;
  Index n_domain;
};

// Sums up to ins[k] are within threshold k, those above outs[k] are not; both increase with k.
struct Thresholds {
  Indices ins;
  Indices outs;
};

// A cell whose division starts at `level` (-1: the cube, before it is looked at): what it violates for certain, and
// the range of its unsettled thresholds.
struct StartCell {
  Index certain;
  Index k_low, k_high;
  int level;
  Index ijk[3];
};

// `*_of` is the threshold a row belongs to, counts are in voxels per threshold. A row of `pending` is a cell to go on
// with: ijk, first plane, first facet plane, end, certain weight, range of thresholds; its planes are rows of
// `pending_numbers`.
struct RelaxedCells {
  Tiles tiles;
  std::vector<std::int32_t> tile_of;
  Leaves leaves;
  std::vector<std::int32_t> leaf_of;
  std::vector<Index> n_inside, n_boundary;
  std::vector<Index> pending;
  std::vector<double> pending_numbers;
  std::vector<Index> pending_weights;
};

RelaxedCells relaxed_cells(const CellPlanes& planes, const Thresholds& thresholds, int depth, const StartCell& start,
                           int stop_level, bool count_only, Stop& stop);

}  // namespace voxkernel
