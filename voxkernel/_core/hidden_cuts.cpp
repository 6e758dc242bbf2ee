#include "hidden_cuts.h"

#include <algorithm>
#include <cstdint>

namespace voxkernel {
namespace {

constexpr Index kFew = 100;    // candidates that are cut to the end
constexpr Index kWorth = 300;  // a look takes as long as a race does for one in so many of an object's voxels

// Some of what is hidden from a candidate and no target yet, far apart in the list.
std::vector<Index> new_targets(const std::vector<Index>& hidden, const std::vector<bool>& is_target, Index most) {
  std::vector<Index> targets, found;
  std::copy_if(hidden.begin(), hidden.end(), std::back_inserter(targets), [&](Index v) { return !is_target[v]; });
  const Index n = static_cast<Index>(targets.size());
  most = std::min(most, n);
  for (Index t = 0; t < most; ++t) found.push_back(targets[(2 * t + 1) * n / (2 * most)]);
  return found;
}

}  // namespace

void cut_by_hidden(VoxelLooks& looks, std::vector<Candidate>& candidates, Index most_looks) {
  std::vector<std::int32_t> counts(static_cast<std::size_t>(looks.crop().size()), 0);
  std::vector<bool> is_target(counts.size(), false);
  std::vector<Index> targets = looks.list_hidden(looks.winner());
  const Index n_all = static_cast<Index>(candidates.size());
  bool is_first = true;  // its targets rule out next to nothing without others
  for (Index n_looks = 1;; ++n_looks) {
    for (const Index target : targets) {
      is_target[target] = true;
      for (const Index v : looks.list_hidden(target)) ++counts[v];
    }
    n_looks += static_cast<Index>(targets.size());
    const auto is_out = [&](const Candidate& c) {
      return looks.is_known(c.voxel) || counts[c.voxel] > looks.enough(c.voxel);
    };
    candidates.erase(std::remove_if(candidates.begin(), candidates.end(), is_out), candidates.end());
    if (candidates.empty() || n_looks > most_looks || looks.is_over()) return;
    const Index n_left = static_cast<Index>(candidates.size());
    if (!is_first && n_left > kFew && kWorth * (n_all - n_left) < n_looks * looks.n_voxels()) return;
    is_first = false;
    const Index voxel =
        std::min_element(candidates.begin(), candidates.end(), [&](const Candidate& a, const Candidate& b) {
          const std::int32_t of_a = counts[a.voxel], of_b = counts[b.voxel];
          return of_a != of_b ? of_a < of_b : looks.is_deeper(a.voxel, b.voxel);
        })->voxel;
    const std::vector<Index>& hidden = looks.list_hidden(voxel);
    targets = new_targets(hidden, is_target, std::max<Index>(1, looks.least() + 1 - counts[voxel]));
  }
}

}  // namespace voxkernel
