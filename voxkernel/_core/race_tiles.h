// Candidates for the best voxel, gathered in tiles.
#pragma once

#include <cstdint>
#include <vector>

#include "label_crop.h"
#include "spans.h"

namespace voxkernel {

// A voxel that may see most.
struct Candidate {
  std::int32_t voxel, ijk[3];
};
// All voxels of an object, the first first.
std::vector<Candidate> all_candidates(const Crop& crop);

// Candidates in a box as large as a tile.
struct RaceTile {
  Index low[3];
  const Candidate *first, *last;
};
// They need not be in line: slabs, bars of each and tiles of each start where there are candidates, which are sorted;
// `scratch` becomes as long as `candidates`.
std::vector<RaceTile> gather_tiles(std::vector<Candidate>& candidates, const Index* edges,
                                   std::vector<Candidate>& scratch);

}  // namespace voxkernel
