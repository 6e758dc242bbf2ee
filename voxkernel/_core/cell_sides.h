// Which side of its faces is the inside of a cell, where the file does not say.
#pragma once

#include "cell_gather.h"
#include "spans.h"
#include "stop.h"

namespace voxkernel {

// Turns the faces of each cell alike, then outward; `flips` is changed in place.
// answer[cell]: 1 done, 0 the sign of the volume is in doubt, -1 some edge does not have two faces,
// -2 no way of turning fits (one-sided), -3 the faces are not connected. Only the first two change the flips.
void orient_cells(const CellMesh& mesh, Span<bool> flips, Span<Index> answer, Stop& stop);

}  // namespace voxkernel
