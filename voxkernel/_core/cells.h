// The kernels of many polyhedral cells in one loop.
#pragma once

#include "cell_gather.h"
#include "spans.h"
#include "stop.h"

namespace voxkernel {

// One row per cell. `outcome` says what decided a cell, or what is wrong with it (see cells.cpp). `numbers` are the
// volume, the diameter, the volume of the kernel and its inradius in world units, as far as known; the first is a
// count of edges for cells that are not closed. `center` is the deepest point of a solid kernel, `witness` names the
// faces that prove an empty one.
struct CellAnswers {
  Span<Index> outcome;
  Rows<double, 4> numbers;
  Rows<double, 3> center;
  Rows<Index, 4> witness;
};

// Solves the cells first .. last - 1, each as far as floating point with bounds goes. `rtol` is as in
// `TriangleMesh.from_polygons`.
void solve_cells(const CellMesh& mesh, Span<const bool> flips, Index first, Index last, double rtol,
                 const CellAnswers& answers, Stop& stop);

}  // namespace voxkernel
