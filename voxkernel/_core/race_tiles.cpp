#include "race_tiles.h"

#include <algorithm>

namespace voxkernel {
namespace {

// Sorts candidates by a coordinate and calls `visit(first, last, lowest)` for those in each stretch of `edge`.
template <typename Visit>
void each_stretch(Candidate* first, Candidate* last, Candidate* scratch, int axis, Index edge, Visit&& visit) {
  Index low = INT64_MAX, high = 0;
  for (Candidate* c = first; c != last; ++c) {
    low = std::min<Index>(low, c->ijk[axis]);
    high = std::max<Index>(high, c->ijk[axis]);
  }
  std::vector<Index> starts(static_cast<std::size_t>(high - low + 2), 0);
  for (Candidate* c = first; c != last; ++c) ++starts[c->ijk[axis] - low + 1];
  for (std::size_t s = 1; s < starts.size(); ++s) starts[s] += starts[s - 1];
  std::vector<Index> at(starts);
  for (Candidate* c = first; c != last; ++c) scratch[at[c->ijk[axis] - low]++] = *c;
  std::copy(scratch, scratch + (last - first), first);
  for (Index from = low; from <= high;) {
    const Index to = std::min(from + edge, high + 1);
    const Index a = starts[from - low], b = starts[to - low];
    if (starts[from - low + 1] == a) {
      ++from;
      continue;
    }
    visit(first + a, first + b, from);
    from = to;
  }
}

}  // namespace

std::vector<Candidate> all_candidates(const Crop& crop) {
  std::vector<Candidate> found;
  Candidate c{0, {0, 0, 0}};
  for (c.ijk[0] = 0; c.ijk[0] < crop.shape[0]; ++c.ijk[0]) {
    for (c.ijk[1] = 0; c.ijk[1] < crop.shape[1]; ++c.ijk[1]) {
      for (c.ijk[2] = 0; c.ijk[2] < crop.shape[2]; ++c.ijk[2], ++c.voxel) {
        if (crop.bytes[c.voxel] != 0) found.push_back(c);
      }
    }
  }
  return found;
}

std::vector<RaceTile> gather_tiles(std::vector<Candidate>& candidates, const Index* edges,
                                   std::vector<Candidate>& scratch) {
  std::vector<RaceTile> found;
  scratch.resize(candidates.size());
  Candidate* to = scratch.data();
  if (candidates.empty()) return found;
  each_stretch(candidates.data(), candidates.data() + candidates.size(), to, 0, edges[0],
               [&](Candidate* a, Candidate* b, Index i) {
                 each_stretch(a, b, to, 1, edges[1], [&](Candidate* c, Candidate* d, Index j) {
                   each_stretch(c, d, to, 2, edges[2],
                                [&](Candidate* e, Candidate* f, Index k) { found.push_back({{i, j, k}, e, f}); });
                 });
               });
  return found;
}

}  // namespace voxkernel
