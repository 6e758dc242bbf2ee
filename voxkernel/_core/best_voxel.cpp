#include "best_voxel.h"

#include <algorithm>
#include <cstdint>
#include <memory>
#include <queue>
#include <vector>

#include "label_rows.h"
#include "label_tiles.h"
#include "tile_race.h"
#include "voxel_looks.h"

namespace voxkernel {
namespace {

constexpr Index kSplit = 3;          // blocks are cut in so many along every axis
constexpr Index kMostBlocks = 1200;  // of the coarsest

// A cube of voxels of the crop, or a square: candidates that are bounded together.
struct Block {
  Index hidden;   // at least so many voxels from each of its voxels
  Index deepest;  // of its voxels
  Index edge;
  Index low[3];
};
// Least hidden first, then the deepest.
struct IsAfter {
  const VoxelLooks* looks;
  bool operator()(const Block& a, const Block& b) const {
    return a.hidden != b.hidden ? a.hidden > b.hidden : looks->is_deeper(b.deepest, a.deepest);
  }
};

// Best first among blocks: each is looked at from its middle in the object widened by half its edge, which tells how
// much is hidden from all of it.
class BlockSearch {
 public:
  BlockSearch(VoxelLooks& looks, const Depths& depths)
      : looks_(looks), crop_(looks.crop()), depths_(depths), queue_(IsAfter{&looks}) {}
  // The least that may be hidden from a voxel that was not looked at because steps were over; INT64_MAX for none.
  Index run();

 private:
  struct Level {
    Index edge;
    std::unique_ptr<LabelRows> rows;
  };

  void climb();
  void cut(const Block& block, Index edge);
  Index bound(const Block& block);
  void look_into(const Block& block);
  Index deepest_of(const Index* low, const Index* edges) const;
  template <typename Visit>
  void each_voxel(const Index* low, const Index* edges, Visit&& visit) const;

  VoxelLooks& looks_;
  const Crop& crop_;
  const Depths& depths_;
  std::vector<Level> levels_;  // the widened ones, finest first
  std::priority_queue<Block, std::vector<Block>, IsAfter> queue_;
  Index open_ = INT64_MAX;
};

// Calls `visit(voxel)` for the voxels of the object in a box.
template <typename Visit>
void BlockSearch::each_voxel(const Index* low, const Index* edges, Visit&& visit) const {
  Index high[3];
  for (int a = 0; a < 3; ++a) high[a] = std::min(low[a] + edges[a], crop_.shape[a]);
  for (Index i = low[0]; i < high[0]; ++i) {
    for (Index j = low[1]; j < high[1]; ++j) {
      for (Index k = low[2]; k < high[2]; ++k) {
        const Index voxel = crop_.flat(i, j, k);
        if (crop_.bytes[voxel] != 0) visit(voxel);
      }
    }
  }
}

// The deepest voxel in a box; -1 where there is none.
Index BlockSearch::deepest_of(const Index* low, const Index* edges) const {
  Index deepest = -1;
  if (depths_.cubes() == nullptr) {
    each_voxel(low, edges, [&](Index v) { deepest = deepest < 0 || looks_.is_deeper(v, deepest) ? v : deepest; });
    return deepest;
  }
  const Index high[3] = {low[0] + edges[0], low[1] + edges[1], low[2] + edges[2]};
  const DeepestVoxels::Found found = depths_.cubes()->find(low, high);
  return found.place == 0 ? deepest : found.voxel;
}

// From the deepest voxel by steps that become shorter: the more is seen from the best so far, the sooner blocks and
// voxels are ruled out.
void BlockSearch::climb() {
  Index step = 1;
  while (64 * step * step * step < looks_.n_voxels()) step *= 2;
  while (step >= 1) {
    Index ijk[3];
    crop_.position(looks_.winner(), ijk);
    bool is_better = false;
    for (Index i = -step; i <= step; i += step) {
      for (Index j = -step; j <= step; j += step) {
        for (Index k = -step; k <= step; k += step) {
          const Index to[3] = {ijk[0] + i, ijk[1] + j, ijk[2] + k};
          bool is_there = !looks_.is_over();
          for (int a = 0; a < 3; ++a) is_there = is_there && to[a] > 0 && to[a] < crop_.shape[a] - 1;
          if (!is_there) continue;
          const Index voxel = crop_.flat(to[0], to[1], to[2]);
          if (crop_.bytes[voxel] != 0) is_better = looks_.consider(voxel) || is_better;
        }
      }
    }
    if (!is_better) step /= 2;
  }
}

// Blocks of a finer edge that have voxels of the object, each with the bound of the whole.
void BlockSearch::cut(const Block& block, Index edge) {
  const Index edges[3] = {edge, edge, edge};
  Index last[3];
  for (int a = 0; a < 3; ++a) last[a] = std::min(block.low[a] + block.edge, crop_.shape[a]);
  for (Index i = block.low[0]; i < last[0]; i += edge) {
    for (Index j = block.low[1]; j < last[1]; j += edge) {
      for (Index k = block.low[2]; k < last[2]; k += edge) {
        const Index low[3] = {i, j, k};
        Block part{block.hidden, deepest_of(low, edges), edge, {i, j, k}};
        if (part.deepest < 0 || part.hidden > looks_.enough(part.deepest)) continue;
        if (!looks_.is_over()) part.hidden = std::max(part.hidden, bound(part));
        if (part.hidden <= looks_.enough(part.deepest)) queue_.push(part);
      }
    }
  }
}

Index BlockSearch::bound(const Block& block) {
  const Index reach = block.edge / 2;
  for (const Level& level : levels_) {
    if (level.edge != block.edge) continue;
    Index middle[3];
    for (int a = 0; a < 3; ++a) middle[a] = block.low[a] + reach;
    if (crop_.is_flat) middle[0] = 1;
    return level.rows->hidden(middle, looks_.enough(block.deepest), looks_.steps(), looks_.stop());
  }
  return 0;
}

// Every voxel of a block of the finest edge, the deepest first.
void BlockSearch::look_into(const Block& block) {
  const Index edges[3] = {block.edge, block.edge, block.edge};
  std::vector<Index> voxels;
  each_voxel(block.low, edges, [&](Index voxel) { voxels.push_back(voxel); });
  std::sort(voxels.begin(), voxels.end(), [&](Index a, Index b) { return looks_.is_deeper(a, b); });
  for (const Index voxel : voxels) {
    if (block.hidden > looks_.enough(voxel)) continue;
    if (looks_.is_over()) {
      open_ = std::min(open_, block.hidden);
      return;
    }
    looks_.consider(voxel);
  }
}

Index BlockSearch::run() {
  const Index n = looks_.n_voxels();
  // From the deepest even if more is seen from the other one: where that leads need not be better.
  const Index other = looks_.winner(), hidden = looks_.least();
  looks_.start_over();
  climb();
  looks_.take(other, hidden);
  Index edge = kSplit;
  while (n / (edge * edge * (crop_.is_flat ? 1 : edge)) > kMostBlocks) edge *= kSplit;
  for (Index e = kSplit; e <= edge; e *= kSplit) {
    levels_.push_back({e, std::make_unique<LabelRows>(crop_, e / 2, &looks_.rows())});
  }
  const Index longest = std::max(crop_.shape[0], std::max(crop_.shape[1], crop_.shape[2]));
  cut({0, looks_.deepest(), longest, {0, 0, 0}}, edge);
  while (!queue_.empty()) {
    const Block block = queue_.top();
    queue_.pop();
    if (block.hidden > looks_.enough(block.deepest)) continue;
    if (looks_.is_over()) {
      open_ = std::min(open_, block.hidden);
      break;
    }
    if (block.edge == kSplit) {
      look_into(block);
    } else {
      cut(block, block.edge / kSplit);
    }
  }
  return open_;
}

}  // namespace

BestVoxel best_voxel(const Crop& crop, const Depths& depths, Index other, Index always, Index most_steps, Stop& stop) {
  VoxelLooks looks(crop, depths, stop);
  const Index n = looks.n_voxels();
  BestVoxel best;
  best.deepest = looks.deepest();
  best.deepest_seen = n - looks.hidden_from_deepest();
  if (crop.bytes[other] != 0) {
    const Index before = looks.n_steps();
    const Index hidden = other == best.deepest ? looks.hidden_from_deepest() : looks.look_at(other, n);
    looks.free_steps_since(before);
    best.other_seen = n - hidden;
    looks.take(other, hidden);
  }
  Index open = INT64_MAX;
  // Only the deepest is needed where it sees all.
  if (looks.least() > 0 || looks.winner() != best.deepest) {
    looks.set_limit(n <= always ? INT64_MAX : most_steps);
    std::unique_ptr<TileRace> race;
    if (LabelTiles::is_small(crop)) race = std::make_unique<TileRace>(looks);
    // Where tiles would take too long or too much memory: blocks that are bounded as a whole.
    open = race != nullptr && race->is_short() ? race->run() : BlockSearch(looks, depths).run();
  }
  best.voxel = looks.winner();
  best.n_seen = n - looks.least();
  best.upper = n - std::min(looks.least(), open);
  best.n_steps = looks.n_steps();
  return best;
}

}  // namespace voxkernel
