// A cell can do no better than what all of it violates for certain; its centre can do no worse than what is
// violated there. Weights are integers, so both bounds are exact.
#include "center.h"

#include <algorithm>
#include <cstdint>
#include <tuple>
#include <vector>

namespace voxkernel {
namespace {

constexpr Index kPlanesACell = 2048;
constexpr int kLevelsAWord = 21;        // of a path, three bits each
constexpr std::size_t kShareTaken = 8;  // of the cells that wait, one in so many is taken at once

// From the cube down to a cell: the children to go through, and how many.
struct Path {
  std::uint64_t high = 0, low = 0;
  int n = 0;

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
  // Cells of one parent are neighbours.
  bool operator<(const Path& other) const { return std::tie(high, low) < std::tie(other.high, other.low); }
};

// A cell that waits to be divided, and what all of it violates.
struct Waiting {
  Path path;
  Index sure;
};

// A cell whose children are open, and those that it has in the domain, the one of the best centre first.
struct Cell : WeighedCell {
  double centre[3] = {0.0, 0.0, 0.0};
  int order[8] = {};
  Path path;
};

// Cells wait with what they violate for certain, and those that violate least are divided next: not one at a time, but
// a share of them in the order of their places, so that the lists of planes of their ancestors are made once for all.
class CenterSearch {
 public:
  CenterSearch(const CubePlanes& planes, double blur, Index best, const Search& search, double* center,
               double* open_cell, Stop& stop)
      : descent_(planes.offsets.size(), search.max_level + 3, stop),
        found_{best, best, 0, false},
        least_open_(best),
        search_(search),
        limits_{blur},
        center_(center),
        open_cell_(open_cell) {
    list_planes(planes, descent_.planes);
    std::fill_n(descent_.open_first(kCube, planes.n_domain, planes.offsets.size()).centre, 3, 0.5);
  }

  Least run() {
    // Straight down to a good point first; what is left beside waits.
    look_at_children(kCube);
    descent_.run(kCube, [this](int slot) { return enter_child(slot, is_first(slot)); });
    while (!waiting_.empty() && !is_over()) divide(take());
    for (const Waiting& cell : waiting_) found_.lower = std::min(found_.lower, cell.sure);
    found_.lower = std::min(found_.lower, found_.best);
    found_.is_over = is_over();
    return found_;
  }

 private:
  static constexpr int kCube = 1;  // the slot of the cube itself

  bool is_over() const { return found_.n_cells >= search_.max_cells || n_planes_ / kPlanesACell >= search_.max_cells; }
  // What violates so much can do no better than what is asked for.
  Index enough() const {
    return found_.best - std::max(search_.gap, static_cast<Index>(search_.ratio * static_cast<double>(found_.best)));
  }
  bool is_first(int slot) const { return descent_.cells[slot].next == 0; }

  // The cells that violate least; `most_taken_` is what the last of them violates.
  std::vector<Waiting> take() {
    const Index limit = enough();
    const auto closed =
        std::partition(waiting_.begin(), waiting_.end(), [&](const Waiting& c) { return c.sure < limit; });
    for (auto cell = closed; cell != waiting_.end(); ++cell) found_.lower = std::min(found_.lower, cell->sure);
    waiting_.erase(closed, waiting_.end());
    if (waiting_.empty()) return {};
    const std::size_t n = 1 + (waiting_.size() - 1) / kShareTaken;
    const auto last = waiting_.begin() + static_cast<std::ptrdiff_t>(n - 1);
    std::nth_element(waiting_.begin(), last, waiting_.end(),
                     [](const Waiting& a, const Waiting& b) { return a.sure < b.sure; });
    most_taken_ = last->sure;
    const auto rest =
        std::partition(waiting_.begin(), waiting_.end(), [&](const Waiting& c) { return c.sure <= most_taken_; });
    std::vector<Waiting> taken(waiting_.begin(), rest);
    waiting_.erase(waiting_.begin(), rest);
    std::sort(taken.begin(), taken.end(), [](const Waiting& a, const Waiting& b) { return a.path < b.path; });
    return taken;
  }

  // Divides cells, and what of them violates no more than the last of them.
  void divide(const std::vector<Waiting>& taken) {
    Path at;  // of the open cells
    for (const Waiting& cell : taken) {
      if (cell.sure >= enough() || is_over()) {
        found_.lower = std::min(found_.lower, cell.sure);
        continue;
      }
      int n_common = 0;
      while (n_common < at.n && n_common < cell.path.n && at.child(n_common) == cell.path.child(n_common)) ++n_common;
      for (int k = n_common; k < cell.path.n; ++k) open(kCube + k, cell.path.child(k));
      const int slot = kCube + cell.path.n;
      descent_.cells[slot].violated = cell.sure;
      at = cell.path;
      look_at_children(slot);
      descent_.run(slot, [this](int s) { return enter_child(s, false); });
    }
  }

  Cell& open(int slot, int c) {
    Cell& child = descent_.narrow(slot, c);
    const Cell& cell = descent_.cells[slot];
    n_planes_ += cell.end - cell.begin;
    to_centre(cell, step_to_child(slot, c), child.centre);
    child.path = cell.path.then(c);
    return child;
  }

  void look_at_children(int slot) {
    descent_.look_at_children(slot, limits_, kNoLimit);
    Cell& cell = descent_.cells[slot];
    n_planes_ += 8 * (cell.end - cell.begin);
    int n = 0;
    for (int c = 0; c < 8; ++c) {
      if (cell.sides[c] == Side::outside) continue;
      const Index at_centre = cell.children[c].possible;
      if (cell.sides[c] == Side::inside && cell.violated + at_centre < found_.best) {
        found_.best = cell.violated + at_centre;
        to_centre(cell, step_to_child(slot, c), center_);
      }
      int at = n++;
      for (; at > 0 && cell.children[cell.order[at - 1]].possible > at_centre; --at)
        cell.order[at] = cell.order[at - 1];
      cell.order[at] = c;
    }
    cell.next = 0;
    cell.n_children = n;
    found_.n_cells += n;
  }

  // Closes the next child of a cell where it can do no better, or is as far as the search goes; whether it is to be
  // divided now. Else it waits.
  bool enter_child(int slot, bool is_now) {
    Cell& cell = descent_.cells[slot];
    const int c = cell.order[cell.next++];
    const Index sure = cell.violated + cell.children[c].certain;
    const bool is_last = slot >= search_.max_level;
    if (sure >= enough() || is_last || is_over()) {
      found_.lower = std::min(found_.lower, sure);
      if (sure < enough() && sure < least_open_ && is_last) {
        least_open_ = sure;
        to_centre(cell, step_to_child(slot, c), open_cell_);
        open_cell_[3] = half_edge(slot);
      }
      return false;
    }
    if (!is_now && sure > most_taken_) {
      waiting_.push_back({cell.path.then(c), sure});
      return false;
    }
    open(slot, c).violated = sure;
    look_at_children(slot + 1);
    return true;
  }

  static void to_centre(const Cell& cell, Step step, double* centre) {
    centre[0] = cell.centre[0] + step.x;
    centre[1] = cell.centre[1] + step.y;
    centre[2] = cell.centre[2] + step.z;
  }

  Descent<Cell, true, true> descent_;
  std::vector<Waiting> waiting_;
  Index most_taken_ = -1;
  Index n_planes_ = 0;  // looked at, once for each cell
  Least found_;
  Index least_open_;
  Search search_;
  CentreLimits limits_;
  double* center_;
  double* open_cell_;
};

}  // namespace

// Finds the least violated weight in the unit cube as closely as `search` says.
//
// `best` is a weight known to be reached; when a centre does better, it is written to `center`. `blur` is by how much
// a centre may move later. The cells that violate least for certain are visited first, so that `lower`, which is
// certain, is as high as it can be when `max_cells` have been looked at; it is further below than asked for then, and
// when cells of `max_level` stay open. `open_cell` is then centre and half edge of the least violated cell of
// `max_level`.
Least least_violated(const CubePlanes& planes, double blur, Index best, const Search& search, double* center,
                     double* open_cell, Stop& stop) {
  return CenterSearch(planes, blur, best, search, center, open_cell, stop).run();
}

}  // namespace voxkernel
