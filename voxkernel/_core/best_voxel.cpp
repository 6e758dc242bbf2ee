#include "best_voxel.h"

#include <algorithm>
#include <cstdint>
#include <memory>
#include <queue>
#include <tuple>
#include <vector>

#include "label_rows.h"
#include "label_tiles.h"

namespace voxkernel {
namespace {

constexpr int kPositionBits = 34;                    // of a rank
constexpr Index kMostPlaces = (Index{1} << 28) - 1;  // of depths
constexpr Index kSplit = 3;                          // blocks are cut in so many along every axis
constexpr Index kMostBlocks = 1200;                  // of the coarsest
constexpr Index kTileSteps = 1;                      // steps of single voxels that take as long as a place of a tile
constexpr Index kShare = 4;  // tiles are bounded where this takes at most such a part of the steps

// A cube of voxels of the crop, or a square: candidates that are bounded together.
struct Block {
  Index hidden;  // at least so many voxels from each of its voxels
  Index rank;    // of its deepest voxel
  Index edge;
  Index low[3];
  // Least hidden first, then the deepest.
  bool operator<(const Block& other) const { return std::tie(other.hidden, other.rank) < std::tie(hidden, rank); }
};

// Best first among blocks: each is looked at from its middle in the object widened by half its edge, which tells how
// much is hidden from all of it.
class Search {
 public:
  Search(const Crop& crop, const Depths& depths, Stop& stop);
  BestVoxel run(Index always, Index most_steps);

 private:
  struct Level {
    Index edge;
    std::unique_ptr<LabelRows> rows;
  };

  struct Tile {
    Index hidden, rank;  // at least so much from each voxel; its deepest voxel, then that of those that may see most
    Index low[3];
    std::vector<Index> bounds;
  };

  bool is_empty(Index i, Index j, Index k, Index n_i, Index n_j, Index n_k) const;
  std::vector<Tile> tiles_of(const Index* edges) const;
  Index n_left(const Index* edges, Tile& tile);
  void race(LabelTiles& tiles, std::vector<Tile>& left);
  void branch();
  void climb();
  void cut(const Block& block, Index edge);
  Index bound(const Block& block);
  void look_into(const Block& block);
  bool consider(Index rank);
  Index enough(Index rank) const { return least_ - (rank < winner_ ? 0 : 1); }
  // Deeper voxels have lower ranks, of those that are equally deep the first; -1 outside. In a large object a rank is
  // made of place and position.
  Index rank_of(Index voxel) const {
    if (!ranks_.empty()) return ranks_[voxel];
    return crop_.bytes[voxel] == 0 ? -1 : (kMostPlaces - depths_.place(voxel)) << kPositionBits | voxel;
  }
  Index voxel_of(Index rank) const {
    return by_depth_.empty() ? rank & ((Index{1} << kPositionBits) - 1) : by_depth_[rank];
  }
  bool is_over() const { return best_.n_steps >= limit_; }
  template <typename Visit>
  void each_voxel(const Index* low, const Index* edges, Visit&& visit) const;

  const Crop& crop_;
  const Depths& depths_;
  Stop& stop_;
  Index n_ = 0;                      // voxels of the object
  std::vector<Index> by_depth_;      // positions in the crop, deepest first; none where depths are given by places
  std::vector<std::int32_t> ranks_;  // of each position, -1 outside
  std::vector<bool> is_known_;       // of each position, whether it was looked at
  LabelRows rows_;
  std::vector<Level> levels_;  // the widened ones, finest first
  std::priority_queue<Block> queue_;
  Index least_ = 0, winner_ = -1;  // what is hidden from the best so far, and its rank
  Index limit_ = 0;
  Index row_steps_ = 0, n_looks_ = 0;  // of voxels looked at one by one
  Index open_ = INT64_MAX;             // the least that may be hidden from a voxel that was not looked at
  BestVoxel best_;
};

Search::Search(const Crop& crop, const Depths& depths, Stop& stop)
    : crop_(crop), depths_(depths), stop_(stop), rows_(crop, 0) {
  Index deepest = -1;
  const auto is_deeper = [&](Index a, Index b) { return depths[a] != depths[b] ? depths[a] > depths[b] : a < b; };
  for (Index v = 0; v < crop.size(); ++v) {
    if (crop.bytes[v] == 0) continue;
    ++n_;
    if (deepest < 0 || is_deeper(v, deepest)) deepest = v;
  }
  // Only the deepest is needed where it sees all.
  Index ijk[3];
  crop.position(deepest, ijk);
  least_ = rows_.hidden(ijk, n_, best_.n_steps, stop);
  row_steps_ = best_.n_steps;
  n_looks_ = 1;
  best_.voxel = best_.deepest = deepest;
  best_.deepest_seen = n_ - least_;
  if (least_ == 0) return;
  if (!depths.has_places()) {
    by_depth_.reserve(static_cast<std::size_t>(n_));
    for (Index v = 0; v < crop.size(); ++v) {
      if (crop.bytes[v] != 0) by_depth_.push_back(v);
    }
    std::sort(by_depth_.begin(), by_depth_.end(), is_deeper);
    ranks_.assign(static_cast<std::size_t>(crop.size()), -1);
    for (Index r = 0; r < n_; ++r) ranks_[by_depth_[r]] = static_cast<std::int32_t>(r);
  }
  is_known_.assign(static_cast<std::size_t>(crop.size()), false);
  is_known_[deepest] = true;
  winner_ = rank_of(deepest);
}

// Calls `visit(rank, place in the box)` for the voxels of the object in a box.
template <typename Visit>
void Search::each_voxel(const Index* low, const Index* edges, Visit&& visit) const {
  Index high[3];
  for (int a = 0; a < 3; ++a) high[a] = std::min(low[a] + edges[a], crop_.shape[a]);
  for (Index i = low[0]; i < high[0]; ++i) {
    for (Index j = low[1]; j < high[1]; ++j) {
      for (Index k = low[2]; k < high[2]; ++k) {
        const Index rank = rank_of(crop_.flat(i, j, k));
        if (rank >= 0) visit(rank, ((i - low[0]) * edges[1] + j - low[1]) * edges[2] + k - low[2]);
      }
    }
  }
}

// Of voxels from which equally much is hidden the deepest counts: the one of the lowest rank.
bool Search::consider(Index rank) {
  const Index voxel = voxel_of(rank);
  if (is_known_[voxel]) return false;
  is_known_[voxel] = true;
  Index ijk[3];
  crop_.position(voxel, ijk);
  const Index before = best_.n_steps;
  const Index h = rows_.hidden(ijk, enough(rank), best_.n_steps, stop_);
  row_steps_ += best_.n_steps - before;
  ++n_looks_;
  if (h > enough(rank)) return false;
  least_ = h;
  winner_ = rank;
  return true;
}

// From the deepest voxel by steps that become shorter: the more is seen from the best so far, the sooner blocks and
// voxels are ruled out.
void Search::climb() {
  Index step = 1;
  const Index n = n_;
  while (64 * step * step * step < n) step *= 2;
  while (step >= 1) {
    Index ijk[3];
    crop_.position(voxel_of(winner_), ijk);
    bool is_better = false;
    for (Index i = -step; i <= step; i += step) {
      for (Index j = -step; j <= step; j += step) {
        for (Index k = -step; k <= step; k += step) {
          const Index to[3] = {ijk[0] + i, ijk[1] + j, ijk[2] + k};
          bool is_there = !is_over();
          for (int a = 0; a < 3; ++a) is_there = is_there && to[a] > 0 && to[a] < crop_.shape[a] - 1;
          if (!is_there) continue;
          const Index rank = rank_of(crop_.flat(to[0], to[1], to[2]));
          if (rank >= 0 && rank != winner_) is_better = consider(rank) || is_better;
        }
      }
    }
    if (!is_better) step /= 2;
  }
}

bool Search::is_empty(Index i, Index j, Index k, Index n_i, Index n_j, Index n_k) const {
  const Index last_i = std::min(i + n_i, crop_.shape[0]), last_j = std::min(j + n_j, crop_.shape[1]);
  const Index n = std::min(n_k, crop_.shape[2] - k);
  for (Index a = i; a < last_i; ++a) {
    for (Index b = j; b < last_j; ++b) {
      const std::uint8_t* bytes = crop_.bytes.data() + crop_.flat(a, b, k);
      if (std::any_of(bytes, bytes + n, [](std::uint8_t byte) { return byte != 0; })) return false;
    }
  }
  return true;
}

// They need not be in line: slabs, bars of each and tiles of each start where there is something of the object.
std::vector<Search::Tile> Search::tiles_of(const Index* edges) const {
  std::vector<Tile> found;
  const Index n_i = crop_.shape[0], n_j = crop_.shape[1], n_k = crop_.shape[2];
  for (Index i = 0; i < n_i;) {
    if (is_empty(i, 0, 0, 1, n_j, n_k)) {
      ++i;
      continue;
    }
    for (Index j = 0; j < n_j;) {
      if (is_empty(i, j, 0, edges[0], 1, n_k)) {
        ++j;
        continue;
      }
      for (Index k = 0; k < n_k;) {
        if (is_empty(i, j, k, edges[0], edges[1], 1)) {
          ++k;
          continue;
        }
        Tile tile{0, INT64_MAX, {i, j, k}, {}};
        each_voxel(tile.low, edges, [&](Index rank, Index) { tile.rank = std::min(tile.rank, rank); });
        found.push_back(std::move(tile));
        k += edges[2];
      }
      j += edges[1];
    }
    i += edges[0];
  }
  std::sort(found.begin(), found.end(), [](const Tile& a, const Tile& b) { return a.rank < b.rank; });
  return found;
}

// How many voxels of a tile are in the race; what was found of the others does not count any more.
Index Search::n_left(const Index* edges, Tile& tile) {
  Index n = 0;
  each_voxel(tile.low, edges, [&](Index rank, Index at) {
    if (is_known_[voxel_of(rank)] || tile.bounds[at] > enough(rank)) tile.bounds[at] = INT64_MAX;
    if (tile.bounds[at] != INT64_MAX) ++n;
  });
  return n;
}

// All tiles are bounded, the deepest first, then by more probes, those first from which the least may be hidden, then
// looked at whole, unless it takes less to look at their voxels one by one. Of those that may see more than any before,
// the most promising voxel is looked at.
void Search::race(LabelTiles& tiles, std::vector<Tile>& left) {
  const Index* edges = tiles.edges();
  Index lowest = 0;
  const auto rate = [&](Tile& tile) {
    tile.hidden = INT64_MAX;
    each_voxel(tile.low, edges, [&](Index rank, Index at) {
      if (std::tie(tile.bounds[at], rank) >= std::tie(tile.hidden, tile.rank)) return;
      tile.hidden = tile.bounds[at];
      tile.rank = rank;
    });
    if (tile.hidden > least_) tile.bounds = {};
    if (tile.hidden >= lowest) return;
    lowest = tile.hidden;
    consider(tile.rank);
  };
  for (int stage = 0; stage <= LabelTiles::kStages; ++stage) {
    std::sort(left.begin(), left.end(),
              [](const Tile& a, const Tile& b) { return std::tie(a.hidden, a.rank) < std::tie(b.hidden, b.rank); });
    lowest = least_;
    for (Tile& tile : left) {
      if (stage == 0) {
        tile.bounds.assign(LabelTiles::kVoxels, 0);
        tiles.bound(0, tile.low, least_, tile.bounds, best_.n_steps, stop_);
        rate(tile);
        continue;
      }
      if (tile.hidden > least_) break;
      if (is_over()) {
        open_ = tile.hidden;
        return;
      }
      const Index n = n_left(edges, tile);
      if (n * row_steps_ <= kTileSteps * tiles.n_places() * n_looks_) {
        each_voxel(tile.low, edges, [&](Index rank, Index at) {
          if (tile.bounds[at] <= enough(rank)) consider(rank);
        });
        tile.hidden = INT64_MAX;
      } else if (stage < LabelTiles::kStages) {
        tiles.bound(stage, tile.low, least_, tile.bounds, best_.n_steps, stop_);
        rate(tile);
      } else {
        tiles.look(tile.low, least_, tile.bounds, best_.n_steps, stop_);
        each_voxel(tile.low, edges, [&](Index rank, Index at) {
          if (tile.bounds[at] > enough(rank)) return;
          least_ = tile.bounds[at];
          winner_ = rank;
        });
      }
    }
  }
}

// Blocks of a finer edge that have voxels of the object, each with the bound of the whole.
void Search::cut(const Block& block, Index edge) {
  const Index edges[3] = {edge, edge, edge};
  Index last[3];
  for (int a = 0; a < 3; ++a) last[a] = std::min(block.low[a] + block.edge, crop_.shape[a]);
  for (Index i = block.low[0]; i < last[0]; i += edge) {
    for (Index j = block.low[1]; j < last[1]; j += edge) {
      for (Index k = block.low[2]; k < last[2]; k += edge) {
        Block part{block.hidden, INT64_MAX, edge, {i, j, k}};
        each_voxel(part.low, edges, [&](Index rank, Index) { part.rank = std::min(part.rank, rank); });
        if (part.rank == INT64_MAX || part.hidden > enough(part.rank)) continue;
        if (!is_over()) part.hidden = std::max(part.hidden, bound(part));
        if (part.hidden <= enough(part.rank)) queue_.push(part);
      }
    }
  }
}

Index Search::bound(const Block& block) {
  const Index reach = block.edge / 2;
  for (const Level& level : levels_) {
    if (level.edge != block.edge) continue;
    Index middle[3];
    for (int a = 0; a < 3; ++a) middle[a] = block.low[a] + reach;
    if (crop_.is_flat) middle[0] = 1;
    return level.rows->hidden(middle, enough(block.rank), best_.n_steps, stop_);
  }
  return 0;
}

// Every voxel of a block of the finest edge, the deepest first.
void Search::look_into(const Block& block) {
  const Index edges[3] = {block.edge, block.edge, block.edge};
  std::vector<Index> ranks;
  each_voxel(block.low, edges, [&](Index rank, Index) { ranks.push_back(rank); });
  std::sort(ranks.begin(), ranks.end());
  for (const Index rank : ranks) {
    if (block.hidden > enough(rank)) continue;
    if (is_over()) {
      open_ = std::min(open_, block.hidden);
      return;
    }
    consider(rank);
  }
}

// Where tiles would take too long or too much memory: blocks that are bounded as a whole.
void Search::branch() {
  climb();
  const Index n = n_;
  Index edge = kSplit;
  while (n / (edge * edge * (crop_.is_flat ? 1 : edge)) > kMostBlocks) edge *= kSplit;
  for (Index e = kSplit; e <= edge; e *= kSplit) levels_.push_back({e, std::make_unique<LabelRows>(crop_, e / 2)});
  const Index longest = std::max(crop_.shape[0], std::max(crop_.shape[1], crop_.shape[2]));
  cut({0, 0, longest, {0, 0, 0}}, edge);
  while (!queue_.empty()) {
    const Block block = queue_.top();
    queue_.pop();
    if (block.hidden > enough(block.rank)) continue;
    if (is_over()) {
      open_ = std::min(open_, block.hidden);
      break;
    }
    if (block.edge == kSplit) {
      look_into(block);
    } else {
      cut(block, block.edge / kSplit);
    }
  }
}

BestVoxel Search::run(Index always, Index most_steps) {
  const Index n = n_;
  if (least_ > 0) {
    limit_ = n <= always ? INT64_MAX : most_steps;
    std::vector<Tile> all;
    std::unique_ptr<LabelTiles> tiles;
    if (LabelTiles::is_small(crop_)) {
      tiles = std::make_unique<LabelTiles>(crop_);
      all = tiles_of(tiles->edges());
    }
    if (tiles != nullptr && static_cast<Index>(all.size()) * tiles->n_places() <= limit_ / kShare) {
      race(*tiles, all);
    } else {
      branch();
    }
  }
  if (winner_ >= 0) best_.voxel = voxel_of(winner_);
  best_.n_seen = n - least_;
  best_.upper = n - std::min(least_, open_);
  return best_;
}

}  // namespace

BestVoxel best_voxel(const Crop& crop, const Depths& depths, Index always, Index most_steps, Stop& stop) {
  return Search(crop, depths, stop).run(always, most_steps);
}

}  // namespace voxkernel
