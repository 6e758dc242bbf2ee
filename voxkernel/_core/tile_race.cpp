#include "tile_race.h"

#include <algorithm>

#include "hidden_cuts.h"
#include "tile_probes.h"

namespace voxkernel {
namespace {

constexpr Index kTileSteps = 1;    // steps of single voxels that take as long as a place of a tile
constexpr Index kAhead = 32;       // candidates of a tile that are looked at before the others
constexpr int kStopped = 3;        // first pass that may be left out where steps are limited
constexpr Index kShare = 4;        // tiles are bounded where this takes at most such a part of the steps
constexpr Index kCutLooks = 60;    // looks that may cut candidates
constexpr Index kCutVoxels = 100;  // voxels of an object for each of these: fewer are raced as fast
constexpr Index kCutHidden = 5;    // looks for each voxel that is hidden from the best
constexpr Index kRaced = 300;      // voxels of an object, for each candidate that is raced in the time of one look
constexpr Index kSample = 256;     // hidden voxels that tell which probes to take

}  // namespace

TileRace::TileRace(VoxelLooks& looks) : looks_(looks), candidates_(all_candidates(looks.crop())) {
  bounds_.assign(static_cast<std::size_t>(looks.crop().size()), 0);
}

bool TileRace::is_short() {
  if (!cut()) return true;
  tiles_ = std::make_unique<LabelTiles>(looks_.crop(), best_order());
  const Index n_tiles = static_cast<Index>(gather_tiles(candidates_, tiles_->edges(), sorted_).size());
  return n_tiles * tiles_->n_places() <= looks_.limit() / kShare;
}

// The order whose first probes find most of what is hidden from the best voxel so far.
int TileRace::best_order() {
  const Crop& crop = looks_.crop();
  const std::vector<Index>& hidden = looks_.list_hidden(looks_.winner());
  const Index n = static_cast<Index>(hidden.size()), n_taken = std::min(n, kSample);
  Index from[3], found[kOrders] = {};
  crop.position(looks_.winner(), from);
  for (Index s = 0; s < n_taken; ++s) {
    Index to[3];
    crop.position(hidden[s * n / n_taken], to);
    for (int order = 0; order < kOrders; ++order) {
      for (int p = 0; p < kProbes[1]; ++p) {
        Index at[3];
        for (int a = 0; a < 3; ++a) {
          const Index d = to[a] - from[a];
          at[a] = d < 0 ? from[a] - probe_at(order, p, -d) : from[a] + probe_at(order, p, d);
        }
        if (crop.bytes[crop.flat(at[0], at[1], at[2])] != 0) continue;
        ++found[order];
        break;
      }
    }
  }
  return static_cast<int>(std::max_element(found, found + kOrders) - found);
}

// Leaves out the candidates from which too much is hidden, and those that were looked at.
void TileRace::drop(std::vector<Candidate>& candidates) const {
  const auto is_out = [&](const Candidate& c) { return !is_open(c); };
  candidates.erase(std::remove_if(candidates.begin(), candidates.end(), is_out), candidates.end());
}

std::vector<TileRace::Tile> TileRace::tiles_by_bound() {
  std::vector<Tile> found;
  for (const RaceTile& tile : gather_tiles(candidates_, tiles_->edges(), sorted_)) {
    const Candidate* best =
        std::min_element(tile.first, tile.last, [&](const auto& a, const auto& b) { return is_before(a, b); });
    found.push_back({tile, bounds_[best->voxel], best->voxel});
  }
  std::sort(found.begin(), found.end(), [&](const Tile& a, const Tile& b) {
    return a.hidden != b.hidden ? a.hidden < b.hidden : looks_.is_deeper(a.voxel, b.voxel);
  });
  return found;
}

// A pass for the candidates of a tile from which at most so much may be hidden.
void TileRace::work(int pass, const RaceTile& tile, Index most) {
  const Index* edges = tiles_->edges();
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
    tiles_->look(tile.low, looks_.least(), hidden_, looks_.steps(), looks_.stop());
  } else {
    tiles_->bound(pass, tile.low, looks_.least(), hidden_, looks_.steps(), looks_.stop());
  }
  for (const Candidate* c = tile.first; c != tile.last; ++c) {
    const Index found = hidden_[at(*c)];
    if (found == INT64_MAX) continue;
    bounds_[c->voxel] = static_cast<std::int32_t>(found);
    if (!is_exact) continue;
    looks_.set_known(c->voxel, true);
    looks_.take(c->voxel, found);
  }
}

// The candidate from which least may be hidden; -1 where there is none.
Index TileRace::promising() const {
  const Candidate* best = nullptr;
  for (const Candidate& c : candidates_) {
    if (is_open(c) && (best == nullptr || is_before(c, *best))) best = &c;
  }
  return best == nullptr ? -1 : best->voxel;
}

// All passes from one on for the candidates about the most promising; of those left, the most promising are looked at
// and the others wait for the last pass.
void TileRace::go_ahead(int pass) {
  const Index seed = promising();
  if (seed < 0) return;
  RaceTile tile{{}, nullptr, nullptr};
  Index ijk[3];
  looks_.crop().position(seed, ijk);
  for (int a = 0; a < 3; ++a) tile.low[a] = std::max<Index>(ijk[a] - tiles_->edges()[a] / 2, 0);
  const auto first = std::stable_partition(candidates_.begin(), candidates_.end(), [&](const Candidate& c) {
    bool is_in = true;
    for (int a = 0; a < 3; ++a) is_in = is_in && c.ijk[a] >= tile.low[a] && c.ijk[a] < tile.low[a] + tiles_->edges()[a];
    return !is_in;
  });
  ahead_.assign(first, candidates_.end());
  candidates_.erase(first, candidates_.end());
  tile.first = ahead_.data();
  tile.last = tile.first + ahead_.size();
  for (; pass < LabelTiles::kBounds; ++pass) work(pass, tile, looks_.least());
  std::vector<Index> bounds;
  for (const Candidate& c : ahead_) {
    if (is_open(c)) bounds.push_back(bounds_[c.voxel]);
  }
  if (bounds.empty()) return;
  const auto nth = bounds.begin() + std::min<Index>(kAhead, static_cast<Index>(bounds.size())) - 1;
  std::nth_element(bounds.begin(), nth, bounds.end());
  work(pass, tile, *nth);
}

// Once, as soon as so little is hidden from the best voxel that this takes less than a race of the candidates left.
// Whether some are left.
bool TileRace::cut() {
  const Index n = looks_.n_voxels(), n_looks = kCutHidden * looks_.least();
  const Index most_looks = std::min(kCutLooks, n / kCutVoxels);
  if (!is_cut_ && n_looks <= most_looks) {
    drop(candidates_);
    if (n_looks * n <= kRaced * static_cast<Index>(candidates_.size())) {
      is_cut_ = true;
      if (!candidates_.empty()) cut_by_hidden(looks_, candidates_, most_looks);
    }
  }
  return !candidates_.empty();
}

Index TileRace::least_open() const {
  Index least = INT64_MAX;
  for (const std::vector<Candidate>* left : {&candidates_, &ahead_}) {
    for (const Candidate& c : *left) {
      if (is_open(c)) least = std::min<Index>(least, bounds_[c.voxel]);
    }
  }
  return least;
}

// Bounds by more and more probes, then whole segments. Between, candidates that are left are gathered in new tiles, and
// once some are taken ahead. Where only few of a tile are left, they are looked at one by one.
Index TileRace::run() {
  if (candidates_.empty()) return INT64_MAX;
  const std::size_t n_all = candidates_.size();
  bool is_ahead = false;
  for (int pass = 0; pass <= LabelTiles::kBounds; ++pass) {
    drop(candidates_);
    if (!is_ahead && (pass == 2 || (pass == 1 && 2 * candidates_.size() < n_all))) {
      is_ahead = true;
      const Index before = looks_.n_steps();
      go_ahead(pass);
      looks_.free_steps_since(before);
      drop(candidates_);
      cut();
    }
    if (pass == LabelTiles::kBounds) {
      drop(ahead_);
      candidates_.insert(candidates_.end(), ahead_.begin(), ahead_.end());
      ahead_.clear();
    }
    for (const Tile& tile : tiles_by_bound()) {
      if (tile.hidden > looks_.least()) break;
      if (pass >= kStopped && looks_.is_over()) return least_open();
      const RaceTile& of = tile.of;
      const Index n = std::count_if(of.first, of.last, [&](const Candidate& c) { return is_open(c); });
      if (pass > 0 && looks_.are_few(n, kTileSteps * tiles_->n_places())) {
        for (const Candidate* c = of.first; c != of.last; ++c) {
          if (is_open(*c)) looks_.consider(c->voxel);
        }
      } else {
        work(pass, of, looks_.least());
      }
    }
    if (pass > 0) continue;
    const Index voxel = promising();
    if (voxel >= 0) looks_.consider(voxel);
    cut();
  }
  return INT64_MAX;
}

}  // namespace voxkernel
