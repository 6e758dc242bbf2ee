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
constexpr Index kMostPlaces = (Index{1} << 28) - 1;  // of depths of cubes
constexpr Index kSplit = 3;                          // blocks are cut in so many along every axis
constexpr Index kMostBlocks = 1200;                  // of the coarsest
constexpr Index kTileSteps = 1;                      // steps of single voxels that take as long as a place of a tile
constexpr Index kAhead = 32;                         // candidates of a tile that are looked at before the others
constexpr int kStopped = 3;                          // first pass that may be left out where steps are limited
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
  Search(const Crop& crop, const Depths& depths, Index other, Stop& stop);
  BestVoxel run(Index always, Index most_steps);

 private:
  struct Level {
    Index edge;
    std::unique_ptr<LabelRows> rows;
  };

  // A voxel that may see most.
  struct Candidate {
    std::int32_t voxel, ijk[3];
  };
  // Those in a box as large as a tile; the least that may be hidden from one of them, and the deepest of these.
  struct Tile {
    Index hidden, voxel;
    Index low[3];
    const Candidate *first, *last;
  };

  bool is_deeper(Index a, Index b) const { return depths_.is_deeper(a, b); }
  // Whether a candidate may still see most, and whether one is more promising than another one.
  bool is_open(const Candidate& c) const { return !is_known_[c.voxel] && bounds_[c.voxel] <= enough(c.voxel); }
  bool is_before(const Candidate& a, const Candidate& b) const {
    const std::int32_t of_a = bounds_[a.voxel], of_b = bounds_[b.voxel];
    return of_a != of_b ? of_a < of_b : is_deeper(a.voxel, b.voxel);
  }
  void race(LabelTiles& tiles);
  void drop(std::vector<Candidate>& candidates) const;
  std::vector<Tile> tiles_of(const Index* edges);
  void work(LabelTiles& tiles, int pass, const Tile& tile, Index most);
  void go_ahead(LabelTiles& tiles, int pass);
  Index promising() const;
  void branch();
  void climb();
  void cut(const Block& block, Index edge);
  Index bound(const Block& block);
  void look_into(const Block& block);
  Index look_at(Index voxel, Index enough);
  bool take(Index voxel, Index hidden);
  bool consider(Index voxel);
  Index enough(Index voxel) const { return least_ - (is_deeper(voxel, winner_) ? 0 : 1); }
  // Deeper voxels have lower ranks, of those that are equally deep the first. In a large object a rank is made of place
  // and position.
  Index deepest_rank(const Index* low, const Index* edges) const;
  Index voxel_of(Index rank) const {
    return by_depth_.empty() ? rank & ((Index{1} << kPositionBits) - 1) : by_depth_[rank];
  }
  bool is_over() const { return best_.n_steps - free_steps_ >= limit_; }
  template <typename Visit>
  void each_voxel(const Index* low, const Index* edges, Visit&& visit) const;

  const Crop& crop_;
  const Depths& depths_;
  Stop& stop_;
  Index n_ = 0;                                         // voxels of the object
  std::vector<Candidate> candidates_, sorted_, ahead_;  // none where the crop is too large for tiles
  std::vector<Index> hidden_;                           // of a tile
  std::vector<std::int32_t> bounds_;  // of each voxel of the crop, how many are hidden from it at least
  std::vector<Index> by_depth_;       // where blocks are bounded, positions, deepest first; none for depths by places
  std::vector<std::int32_t> ranks_;   // of each position, -1 outside
  std::vector<bool> is_known_;        // of each voxel of the crop, whether it was looked at
  LabelRows rows_;
  std::vector<Level> levels_;  // the widened ones, finest first
  std::priority_queue<Block> queue_;
  Index least_ = 0, winner_ = 0;       // what is hidden from the best so far, and its position
  Index limit_ = 0, free_steps_ = 0;   // how many steps may be taken, and what does not count as such
  Index row_steps_ = 0, n_looks_ = 0;  // of voxels looked at one by one
  Index open_ = INT64_MAX;             // the least that may be hidden from a voxel that was not looked at
  BestVoxel best_;
};

Search::Search(const Crop& crop, const Depths& depths, Index other, Stop& stop)
    : crop_(crop), depths_(depths), stop_(stop), rows_(crop, 0) {
  const bool is_small = LabelTiles::is_small(crop);
  Index v = 0;
  winner_ = -1;
  for (Index i = 0; i < crop.shape[0]; ++i) {
    for (Index j = 0; j < crop.shape[1]; ++j) {
      for (Index k = 0; k < crop.shape[2]; ++k, ++v) {
        if (crop.bytes[v] == 0) continue;
        ++n_;
        if (is_small) {
          candidates_.push_back(
              {static_cast<std::int32_t>(v),
               {static_cast<std::int32_t>(i), static_cast<std::int32_t>(j), static_cast<std::int32_t>(k)}});
        }
        if (depths.cubes() == nullptr && (winner_ < 0 || is_deeper(v, winner_))) winner_ = v;
      }
    }
  }
  if (depths.cubes() != nullptr) {
    const Index low[3] = {0, 0, 0};
    winner_ = voxel_of(deepest_rank(low, crop.shape));
  }
  is_known_.assign(static_cast<std::size_t>(crop.size()), false);
  best_.deepest = winner_;
  least_ = look_at(winner_, n_);
  best_.deepest_seen = n_ - least_;
  if (crop.bytes[other] == 0) return;
  const Index before = best_.n_steps;
  const Index h = other == best_.deepest ? least_ : look_at(other, n_);
  free_steps_ = best_.n_steps - before;
  best_.other_seen = n_ - h;
  take(other, h);
}

// The voxel is the best so far if no more than this is hidden from it.
bool Search::take(Index voxel, Index hidden) {
  if (hidden > enough(voxel)) return false;
  least_ = hidden;
  winner_ = voxel;
  return true;
}

// How many voxels are hidden from one; some number above `enough` where there are more.
Index Search::look_at(Index voxel, Index enough) {
  is_known_[voxel] = true;
  Index ijk[3];
  crop_.position(voxel, ijk);
  const Index before = best_.n_steps;
  const Index h = rows_.hidden(ijk, enough, best_.n_steps, stop_);
  row_steps_ += best_.n_steps - before;
  ++n_looks_;
  return h;
}

// Calls `visit(voxel)` for the voxels of the object in a box.
template <typename Visit>
void Search::each_voxel(const Index* low, const Index* edges, Visit&& visit) const {
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

// The rank of the deepest voxel in a box; INT64_MAX where there is none.
Index Search::deepest_rank(const Index* low, const Index* edges) const {
  Index rank = INT64_MAX;
  if (depths_.cubes() == nullptr) {
    each_voxel(low, edges, [&](Index voxel) { rank = std::min<Index>(rank, ranks_[voxel]); });
    return rank;
  }
  const Index high[3] = {low[0] + edges[0], low[1] + edges[1], low[2] + edges[2]};
  const DeepestVoxels::Found found = depths_.cubes()->find(low, high);
  return found.place == 0 ? rank : (kMostPlaces - found.place) << kPositionBits | found.voxel;
}

// Of voxels from which equally much is hidden the deepest counts.
bool Search::consider(Index voxel) {
  if (is_known_[voxel]) return false;
  return take(voxel, look_at(voxel, enough(voxel)));
}

// From the deepest voxel by steps that become shorter: the more is seen from the best so far, the sooner blocks and
// voxels are ruled out.
void Search::climb() {
  Index step = 1;
  while (64 * step * step * step < n_) step *= 2;
  while (step >= 1) {
    Index ijk[3];
    crop_.position(winner_, ijk);
    bool is_better = false;
    for (Index i = -step; i <= step; i += step) {
      for (Index j = -step; j <= step; j += step) {
        for (Index k = -step; k <= step; k += step) {
          const Index to[3] = {ijk[0] + i, ijk[1] + j, ijk[2] + k};
          bool is_there = !is_over();
          for (int a = 0; a < 3; ++a) is_there = is_there && to[a] > 0 && to[a] < crop_.shape[a] - 1;
          if (!is_there) continue;
          const Index voxel = crop_.flat(to[0], to[1], to[2]);
          if (crop_.bytes[voxel] != 0) is_better = consider(voxel) || is_better;
        }
      }
    }
    if (!is_better) step /= 2;
  }
}

// Leaves out the candidates from which too much is hidden, and those that were looked at.
void Search::drop(std::vector<Candidate>& candidates) const {
  const auto is_out = [&](const Candidate& c) { return !is_open(c); };
  candidates.erase(std::remove_if(candidates.begin(), candidates.end(), is_out), candidates.end());
}

// Sorts candidates by a coordinate and calls `visit(first, last, lowest)` for those in each stretch of `edge`.
template <typename Candidate, typename Visit>
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

// They need not be in line: slabs, bars of each and tiles of each start where there are candidates.
std::vector<Search::Tile> Search::tiles_of(const Index* edges) {
  std::vector<Tile> found;
  sorted_.resize(candidates_.size());
  Candidate* scratch = sorted_.data();
  if (candidates_.empty()) return found;
  each_stretch(candidates_.data(), candidates_.data() + candidates_.size(), scratch, 0, edges[0],
               [&](Candidate* a, Candidate* b, Index i) {
                 each_stretch(a, b, scratch, 1, edges[1], [&](Candidate* c, Candidate* d, Index j) {
                   each_stretch(c, d, scratch, 2, edges[2], [&](Candidate* e, Candidate* f, Index k) {
                     const Candidate* best =
                         std::min_element(e, f, [&](const auto& v, const auto& w) { return is_before(v, w); });
                     found.push_back({bounds_[best->voxel], best->voxel, {i, j, k}, e, f});
                   });
                 });
               });
  std::sort(found.begin(), found.end(), [&](const Tile& a, const Tile& b) {
    return a.hidden != b.hidden ? a.hidden < b.hidden : is_deeper(a.voxel, b.voxel);
  });
  return found;
}

// A pass for the candidates of a tile from which at most so much may be hidden.
void Search::work(LabelTiles& tiles, int pass, const Tile& tile, Index most) {
  const Index* edges = tiles.edges();
  const auto at = [&](const Candidate& c) {
    return ((c.ijk[0] - tile.low[0]) * edges[1] + c.ijk[1] - tile.low[1]) * edges[2] + c.ijk[2] - tile.low[2];
  };
  bool is_any = false;
  hidden_.assign(LabelTiles::kVoxels, INT64_MAX);
  for (const Candidate* c = tile.first; c != tile.last; ++c) {
    if (!is_open(*c) || bounds_[c->voxel] > most) continue;
    hidden_[at(*c)] = bounds_[c->voxel];
    is_any = true;
  }
  if (!is_any) return;
  const bool is_exact = pass == LabelTiles::kBounds;
  if (is_exact) {
    tiles.look(tile.low, least_, hidden_, best_.n_steps, stop_);
  } else {
    tiles.bound(pass, tile.low, least_, hidden_, best_.n_steps, stop_);
  }
  for (const Candidate* c = tile.first; c != tile.last; ++c) {
    const Index found = hidden_[at(*c)];
    if (found == INT64_MAX) continue;
    bounds_[c->voxel] = static_cast<std::int32_t>(found);
    if (!is_exact) continue;
    is_known_[c->voxel] = true;
    take(c->voxel, found);
  }
}

// The candidate from which least may be hidden; -1 where there is none.
Index Search::promising() const {
  const Candidate* best = nullptr;
  for (const Candidate& c : candidates_) {
    if (is_open(c) && (best == nullptr || is_before(c, *best))) best = &c;
  }
  return best == nullptr ? -1 : best->voxel;
}

// All passes from one on for the candidates about the most promising; of those left, the most promising are looked at
// and the others wait for the last pass.
void Search::go_ahead(LabelTiles& tiles, int pass) {
  const Index seed = promising();
  if (seed < 0) return;
  Tile tile{0, seed, {}, nullptr, nullptr};
  Index ijk[3];
  crop_.position(seed, ijk);
  for (int a = 0; a < 3; ++a) tile.low[a] = std::max<Index>(ijk[a] - tiles.edges()[a] / 2, 0);
  const auto first = std::stable_partition(candidates_.begin(), candidates_.end(), [&](const Candidate& c) {
    bool is_in = true;
    for (int a = 0; a < 3; ++a) is_in = is_in && c.ijk[a] >= tile.low[a] && c.ijk[a] < tile.low[a] + tiles.edges()[a];
    return !is_in;
  });
  ahead_.assign(first, candidates_.end());
  candidates_.erase(first, candidates_.end());
  tile.first = ahead_.data();
  tile.last = tile.first + ahead_.size();
  for (; pass < LabelTiles::kBounds; ++pass) work(tiles, pass, tile, least_);
  std::vector<Index> bounds;
  for (const Candidate& c : ahead_) {
    if (is_open(c)) bounds.push_back(bounds_[c.voxel]);
  }
  if (bounds.empty()) return;
  const auto nth = bounds.begin() + std::min<Index>(kAhead, static_cast<Index>(bounds.size())) - 1;
  std::nth_element(bounds.begin(), nth, bounds.end());
  work(tiles, pass, tile, *nth);
}

// Bounds by more and more probes, then whole segments. Between, candidates that are left are gathered in new tiles, and
// once some are taken ahead. Where only few of a tile are left, they are looked at one by one.
void Search::race(LabelTiles& tiles) {
  const std::size_t n_all = candidates_.size();
  bool is_ahead = false;
  for (int pass = 0; pass <= LabelTiles::kBounds; ++pass) {
    drop(candidates_);
    if (!is_ahead && (pass == 2 || (pass == 1 && 2 * candidates_.size() < n_all))) {
      is_ahead = true;
      const Index before = best_.n_steps;
      go_ahead(tiles, pass);
      free_steps_ += best_.n_steps - before;
      drop(candidates_);
    }
    if (pass == LabelTiles::kBounds) {
      drop(ahead_);
      candidates_.insert(candidates_.end(), ahead_.begin(), ahead_.end());
      ahead_.clear();
    }
    for (const Tile& tile : tiles_of(tiles.edges())) {
      if (tile.hidden > least_) break;
      if (pass >= kStopped && is_over()) {
        for (const std::vector<Candidate>* left : {&candidates_, &ahead_}) {
          for (const Candidate& c : *left) {
            if (is_open(c)) open_ = std::min<Index>(open_, bounds_[c.voxel]);
          }
        }
        return;
      }
      Index n = 0;
      for (const Candidate* c = tile.first; c != tile.last; ++c) n += is_open(*c) ? 1 : 0;
      if (pass > 0 && n * row_steps_ <= kTileSteps * tiles.n_places() * n_looks_) {
        for (const Candidate* c = tile.first; c != tile.last; ++c) {
          if (is_open(*c)) consider(c->voxel);
        }
      } else {
        work(tiles, pass, tile, least_);
      }
    }
    if (pass > 0) continue;
    const Index voxel = promising();
    if (voxel >= 0) consider(voxel);
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
        part.rank = deepest_rank(part.low, edges);
        if (part.rank == INT64_MAX || part.hidden > enough(voxel_of(part.rank))) continue;
        if (!is_over()) part.hidden = std::max(part.hidden, bound(part));
        if (part.hidden <= enough(voxel_of(part.rank))) queue_.push(part);
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
    return level.rows->hidden(middle, enough(voxel_of(block.rank)), best_.n_steps, stop_);
  }
  return 0;
}

// Every voxel of a block of the finest edge, the deepest first.
void Search::look_into(const Block& block) {
  const Index edges[3] = {block.edge, block.edge, block.edge};
  std::vector<Index> voxels;
  each_voxel(block.low, edges, [&](Index voxel) { voxels.push_back(voxel); });
  std::sort(voxels.begin(), voxels.end(), [&](Index a, Index b) { return is_deeper(a, b); });
  for (const Index voxel : voxels) {
    if (block.hidden > enough(voxel)) continue;
    if (is_over()) {
      open_ = std::min(open_, block.hidden);
      return;
    }
    consider(voxel);
  }
}

// Where tiles would take too long or too much memory: blocks that are bounded as a whole.
void Search::branch() {
  if (depths_.cubes() == nullptr) {
    by_depth_.reserve(static_cast<std::size_t>(n_));
    for (Index v = 0; v < crop_.size(); ++v) {
      if (crop_.bytes[v] != 0) by_depth_.push_back(v);
    }
    std::sort(by_depth_.begin(), by_depth_.end(), [&](Index a, Index b) { return is_deeper(a, b); });
    ranks_.assign(static_cast<std::size_t>(crop_.size()), -1);
    for (Index r = 0; r < n_; ++r) ranks_[by_depth_[r]] = static_cast<std::int32_t>(r);
  }
  // From the deepest even if more is seen from the other one: where that leads need not be better.
  const Index other = winner_, hidden = least_;
  if (other != best_.deepest) is_known_[other] = false;
  winner_ = best_.deepest;
  least_ = n_ - best_.deepest_seen;
  climb();
  take(other, hidden);
  Index edge = kSplit;
  while (n_ / (edge * edge * (crop_.is_flat ? 1 : edge)) > kMostBlocks) edge *= kSplit;
  for (Index e = kSplit; e <= edge; e *= kSplit) {
    levels_.push_back({e, std::make_unique<LabelRows>(crop_, e / 2, &rows_)});
  }
  const Index longest = std::max(crop_.shape[0], std::max(crop_.shape[1], crop_.shape[2]));
  cut({0, 0, longest, {0, 0, 0}}, edge);
  while (!queue_.empty()) {
    const Block block = queue_.top();
    queue_.pop();
    if (block.hidden > enough(voxel_of(block.rank))) continue;
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
  // Only the deepest is needed where it sees all.
  if (least_ > 0 || winner_ != best_.deepest) {
    limit_ = n_ <= always ? INT64_MAX : most_steps;
    std::unique_ptr<LabelTiles> tiles;
    if (LabelTiles::is_small(crop_)) {
      tiles = std::make_unique<LabelTiles>(crop_);
      bounds_.assign(static_cast<std::size_t>(crop_.size()), 0);
    }
    if (tiles != nullptr &&
        static_cast<Index>(tiles_of(tiles->edges()).size()) * tiles->n_places() <= limit_ / kShare) {
      race(*tiles);
    } else {
      branch();
    }
  }
  best_.voxel = winner_;
  best_.n_seen = n_ - least_;
  best_.upper = n_ - std::min(least_, open_);
  return best_;
}

}  // namespace

BestVoxel best_voxel(const Crop& crop, const Depths& depths, Index other, Index always, Index most_steps, Stop& stop) {
  return Search(crop, depths, other, stop).run(always, most_steps);
}

}  // namespace voxkernel
