#include "best_voxel.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "label_blocks.h"
#include "label_view.h"

namespace voxkernel {
namespace {

constexpr Index kFewTargets = 192, kTargets = 1024;  // of the search, in one fixed random order
constexpr Index kStarts = 128, kClimbs = 3;
constexpr Index kMostBlocks = 1200;
constexpr Index kSmall = 10000;  // voxels

struct Place {
  std::int32_t ijk[3];
};

class Search {
 public:
  Search(const Crop& crop, Doubles depths, Stop& stop);
  BestVoxel run(Index always, Index most_steps);

 private:
  bool sees(Index from, Index to);
  Index hidden(Index from, Index n_targets, Index enough);
  Index count(Index v);
  void consider(Index v);
  void climb();
  Index climbed(Index start);
  void bound();
  void race(Index limit);
  Index hidden_in_race(Index v, Index enough);
  Index least_hidden(Index v) const { return blocks_.hidden[blocks_.of_voxel[v]]; }

  const Crop& crop_;
  Stop& stop_;
  LabelView view_;
  std::vector<Index> voxels_;  // positions in the crop
  std::vector<Place> places_;
  std::vector<Index> by_depth_;       // deepest first
  std::vector<Index> targets_;        // a random order
  std::vector<std::int32_t> number_;  // of each position, -1 outside; made when needed
  LabelBlocks blocks_;
  BestVoxel best_;
  Index best_voxel_ = 0;  // its number
};

Search::Search(const Crop& crop, Doubles depths, Stop& stop) : crop_(crop), stop_(stop), view_(crop) {
  for (Index v = 0; v < crop.size(); ++v) {
    if (crop.bytes[v] != 0) voxels_.push_back(v);
  }
  const Index n = static_cast<Index>(voxels_.size());
  places_.resize(n);
  by_depth_.resize(n);
  for (Index v = 0; v < n; ++v) {
    Index ijk[3];
    crop.position(voxels_[v], ijk);
    for (int a = 0; a < 3; ++a) places_[v].ijk[a] = static_cast<std::int32_t>(ijk[a]);
    by_depth_[v] = v;
  }
  // Only the deepest is needed where it sees all.
  const auto is_deeper = [&](Index a, Index b) {
    const double one = depths[voxels_[a]], two = depths[voxels_[b]];
    return one != two ? one > two : a < b;
  };
  std::iter_swap(by_depth_.begin(), std::min_element(by_depth_.begin(), by_depth_.end(), is_deeper));
  best_voxel_ = by_depth_[0];
  best_.deepest = best_.voxel = voxels_[best_voxel_];
  best_.deepest_seen = best_.n_seen = count(best_voxel_);
  best_.upper = n;
  if (best_.n_seen == n) return;
  std::sort(by_depth_.begin(), by_depth_.end(), is_deeper);
  targets_.resize(n);
  for (Index v = 0; v < n; ++v) targets_[v] = v;
  std::uint64_t state = 88172645463325252u;  // Marsaglia's xorshift, the same for every object
  for (Index v = n - 1; v > 0; --v) {
    state ^= state << 13;
    state ^= state >> 7;
    state ^= state << 17;
    std::swap(targets_[v], targets_[static_cast<Index>(state % static_cast<std::uint64_t>(v + 1))]);
  }
}

bool Search::sees(Index from, Index to) {
  Index d[3];
  for (int a = 0; a < 3; ++a) d[a] = places_[to].ijk[a] - places_[from].ijk[a];
  const Index before = best_.n_steps;
  const bool is_seen = view_.sees(voxels_[from], d, best_.n_steps);
  stop_.poll(1 + best_.n_steps - before);
  return is_seen;
}

Index Search::hidden(Index from, Index n_targets, Index enough) {
  Index n = 0;
  for (Index t = 0; t < n_targets && n < enough; ++t) n += sees(from, targets_[t]) ? 0 : 1;
  return n;
}

Index Search::count(Index v) {
  const Index center[3] = {places_[v].ijk[0], places_[v].ijk[1], places_[v].ijk[2]};
  best_.n_steps += crop_.size();
  return view_.count(center, {}, stop_);
}

void Search::consider(Index v) {
  const Index n = count(v);
  if (n <= best_.n_seen) return;
  best_.n_seen = n;
  best_voxel_ = v;
}

// A few good starts among voxels spread over all depths, and steps that become shorter from each.
void Search::climb() {
  const Index n = static_cast<Index>(voxels_.size());
  const Index few = std::min(n, kFewTargets);
  number_.assign(crop_.size(), -1);
  for (Index v = 0; v < n; ++v) number_[voxels_[v]] = static_cast<std::int32_t>(v);
  std::vector<std::pair<Index, Index>> starts;  // hidden, voxel
  const Index stride = std::max<Index>(1, n / kStarts);
  for (Index at = stride / 2; at < n; at += stride) {
    const Index enough = static_cast<Index>(starts.size()) < kClimbs ? few + 1 : starts.back().first;
    const Index h = hidden(by_depth_[at], few, enough);
    if (h >= enough) continue;
    const std::pair<Index, Index> start{h, by_depth_[at]};
    starts.insert(std::upper_bound(starts.begin(), starts.end(), start,
                                   [](const auto& a, const auto& b) { return a.first < b.first; }),
                  start);
    if (static_cast<Index>(starts.size()) > kClimbs) starts.pop_back();
  }
  consider(climbed(by_depth_[0]));
  for (const auto& start : starts) {
    if (best_.n_seen == n) return;
    consider(climbed(start.second));
  }
}

Index Search::climbed(Index start) {
  // Small objects are raced through anyway: a good start is enough.
  const Index n = static_cast<Index>(voxels_.size());
  const Index n_targets = std::min(n, n <= kSmall ? kFewTargets : kTargets);
  Index at = start, least = hidden(at, n_targets, n_targets + 1);
  Index step = std::max<Index>(1, static_cast<Index>(std::cbrt(static_cast<double>(voxels_.size())) / 5.0));
  while (step >= 1 && least > 0) {
    Index next = at;
    for (Index i = -step; i <= step; i += step) {
      for (Index j = -step; j <= step; j += step) {
        for (Index k = -step; k <= step; k += step) {
          const Index to[3] = {places_[at].ijk[0] + i, places_[at].ijk[1] + j, places_[at].ijk[2] + k};
          bool is_there = true;
          for (int a = 0; a < 3; ++a) is_there = is_there && to[a] > 0 && to[a] < crop_.shape[a] - 1;
          if (!is_there) continue;
          const Index v = number_[crop_.flat(to[0], to[1], to[2])];
          if (v < 0 || v == at) continue;
          const Index h = hidden(v, n_targets, least);
          if (h >= least) continue;
          least = h;
          next = v;
        }
      }
    }
    if (next == at) step /= 2;
    at = next;
  }
  return at;
}

// How many voxels at least are hidden from each, told by blocks.
void Search::bound() {
  const Index n = static_cast<Index>(voxels_.size());
  const Index enough = n - best_.n_seen;
  Index edge = 2;
  while (n / (edge * edge * (crop_.is_flat ? 1 : edge)) > kMostBlocks) ++edge;
  blocks_ = bound_blocks(crop_, voxels_, edge, enough, stop_, best_.n_steps);
}

// What is hidden from the whole block of a candidate counts at once. Targets that were hidden from one candidate come
// earlier for the next. Where they do not decide, all voxels are
// counted at once, which is faster than one by one.
Index Search::hidden_in_race(Index v, Index enough) {
  const Index n = static_cast<Index>(voxels_.size());
  const Index tried = std::min(n, 2 * enough + crop_.size() / 16);
  const std::uint8_t* is_hidden = blocks_.is_hidden.data() + blocks_.of_voxel[v] * blocks_.size();
  Index h = least_hidden(v);
  for (Index t = 0; t < tried; ++t) {
    if (is_hidden[blocks_.of_voxel[targets_[t]]] != 0) continue;
    if (sees(v, targets_[t])) continue;
    if (++h >= enough) {
      std::swap(targets_[t], targets_[t / 2]);
      return h;
    }
    std::swap(targets_[t], targets_[t / 2]);
  }
  return tried == n ? h : n - count(v);
}

// Every voxel that may be the best, deepest first; one that sees as much as the best so far wins only if it is deeper.
void Search::race(Index limit) {
  const Index n = static_cast<Index>(voxels_.size());
  Index least = n - best_.n_seen + 1, winner = -1;
  Index open = n;  // the least that a voxel may hide that was not looked at
  std::size_t at = 0;
  for (; at < by_depth_.size() && best_.n_steps < limit; ++at) {
    const Index v = by_depth_[at];
    if (least_hidden(v) >= least) continue;
    const Index h = hidden_in_race(v, least);
    if (h >= least) continue;
    least = h;
    winner = v;
    if (h == 0) break;
  }
  if (winner >= 0) {
    best_.n_seen = n - least;
    best_voxel_ = winner;
  }
  if (least > 0) {
    for (; at < by_depth_.size(); ++at) open = std::min(open, least_hidden(by_depth_[at]));
  }
  best_.upper = std::max(best_.n_seen, n - open);
}

BestVoxel Search::run(Index always, Index most_steps) {
  const Index n = static_cast<Index>(voxels_.size());
  if (best_.n_seen < n) {
    climb();
    bound();
    race(n <= always ? INT64_MAX : most_steps);
    best_.voxel = voxels_[best_voxel_];
  }
  return best_;
}

}  // namespace

BestVoxel best_voxel(const Crop& crop, Doubles depths, Index always, Index most_steps, Stop& stop) {
  return Search(crop, depths, stop).run(always, most_steps);
}

}  // namespace voxkernel
