// Candidates ruled out by looking from what they do not see.
#pragma once

#include <vector>

#include "race_tiles.h"
#include "voxel_looks.h"

namespace voxkernel {

// Sight is mutual: a voxel that is hidden from the best one so far tells, looked at, from which others it is hidden.
// So many of these targets as are hidden from a candidate, so much is hidden from it at least. Where little is hidden
// from the best one, few targets rule out nearly all the others. Candidates that may still be the best are left; no new
// targets are taken once there were so many looks, or these rule out less than a race would in the same time.
void cut_by_hidden(VoxelLooks& looks, std::vector<Candidate>& candidates, Index most_looks);

}  // namespace voxkernel
