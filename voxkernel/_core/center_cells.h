// Cells that the search for a centre divides: one at a time, down to what violates little, on a thread of its own.
#pragma once

#include <cstdint>
#include <deque>
#include <limits>
#include <tuple>
#include <utility>
#include <vector>

#include "center.h"
#include "facet_lists.h"
#include "plane_list.h"
#include "spans.h"
#include "stop.h"

namespace voxkernel {

// From the cube down to a cell: the children to go through, and how many.
struct Path {
  static constexpr int kLevelsAWord = 21;  // three bits each
  std::uint64_t high = 0, low = 0;
  std::int32_t n = 0;

  Path then(int child) const {
    Path path = *this;
    std::uint64_t& word = n < kLevelsAWord ? path.high : path.low;
    word |= static_cast<std::uint64_t>(child) << (3 * (kLevelsAWord - 1 - n % kLevelsAWord));
    ++path.n;
    return path;
  }
  int child(int k) const {
    return static_cast<int>((k < kLevelsAWord ? high : low) >> (3 * (kLevelsAWord - 1 - k % kLevelsAWord)) & 7u);
  }
  int common_with(const Path& other) const {
    int k = 0;
    while (k < n && k < other.n && child(k) == other.child(k)) ++k;
    return k;
  }
  // Cells of one parent are neighbours.
  bool operator<(const Path& other) const { return std::tie(high, low) < std::tie(other.high, other.low); }
};

// A cell that waits to be divided, what all of it violates, and how many planes its parent has.
struct Waiting {
  std::uint64_t high, low;
  std::int32_t n;
  std::uint32_t n_planes;
  Index sure;

  Waiting(const Path& path, Index planes, Index violated)
      : high(path.high), low(path.low), n(path.n), n_planes(static_cast<std::uint32_t>(planes)), sure(violated) {}
  Path path() const { return {high, low, n}; }
};

// Many, in small blocks: to grow moves none of them, and blocks that are given back serve again.
using WaitingCells = std::deque<Waiting>;

// What the cells of one round are divided by. None of it changes before all are, so that it does not matter which
// thread divides which, nor in which order.
struct Round {
  Index best;                     // reached before
  Index least_open;               // of the cells of the last level so far
  Index most_taken;               // what violates no more is divided at once, the rest waits
  bool is_straight;               // straight down to a good point first: the best child is divided, the others wait
  Index most_cells, most_planes;  // for each of the cells
};

// What cells have come to. Of the same numbers those of the first cell count.
struct Outcome {
  static constexpr Index kNone = std::numeric_limits<Index>::max();
  Index best = kNone, best_of = kNone;
  double center[3] = {};
  Index least_open = kNone, open_of = kNone;
  double open_cell[4] = {};
  Index lower = kNone;  // of what was closed
  Index n_cells = 0, n_planes = 0;
  WaitingCells waiting;

  void add(Outcome&& other);
};

class CellDivider {
 public:
  CellDivider(const FramedPlanes& facets, const Border& border, double blur, const Search& search);

  // Divides cell `index` of a round and what of it is to be divided at once. `before` is the path of the one before it.
  void divide(const Waiting& cell, Index index, const Path& before, const Round& round, Stop& stop);
  Outcome take() { return std::exchange(outcome_, Outcome{}); }
  // What violates so much can do no better than what is asked for.
  static Index enough(const Search& search, Index best);

 private:
  // A cell whose children are open, and those that it has in the domain, the one of the best centre first.
  struct Cell {
    Path path;
    double centre[3] = {0.5, 0.5, 0.5};
    Index border_begin = 0, border_end = 0;
    FacetLists::List facets;
    Index violated = 0;
    Weights children[8] = {};
    Side sides[8] = {};
    int order[8] = {};
    int next = 0, n_children = 0;
  };

  bool is_over() const { return n_cells_ >= round_->most_cells || n_planes_ >= round_->most_planes; }
  bool is_closed(Index sure) const { return sure >= enough(search_, best_); }
  Cell& at(int slot) { return cells_[static_cast<std::size_t>(slot)]; }
  void open(int slot, int c);
  void look_at_children(int slot);
  bool enter_child(int slot);
  static void to_centre(const Cell& cell, const Step& step, double* centre);

  FacetLists facets_;
  PlaneList<true, true> border_;
  std::vector<Cell> cells_;
  Path at_;  // of the open cells
  CentreLimits limits_;
  Search search_;
  Outcome outcome_;
  // Of the cell that is divided.
  const Round* round_ = nullptr;
  Stop* stop_ = nullptr;
  Index index_ = 0, best_ = 0, least_open_ = 0, n_cells_ = 0, n_planes_ = 0;
};

}  // namespace voxkernel
