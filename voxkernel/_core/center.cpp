// A cell can do no better than what all of it violates for certain; its centre can do no worse than what is
// violated there. Weights are integers, so both bounds are exact.
#include "center.h"

#include <algorithm>

namespace voxkernel {
namespace {

// A cell whose children are open, and those that it has in the domain, the one of the best centre first.
struct Cell : WeighedCell {
  double centre[3] = {0.0, 0.0, 0.0};
  int order[8] = {};
};

class CenterSearch {
 public:
  CenterSearch(const CubePlanes& planes, double blur, Index best, const Search& search, double* center,
               double* open_cell, Stop& stop)
      : descent_(planes.offsets.size(), search.max_level + 3, stop),
        found_{best, best, 0},
        least_open_(best),
        search_(search),
        limits_{blur},
        center_(center),
        open_cell_(open_cell) {
    list_planes(planes, descent_.planes);
    std::fill_n(descent_.open_first(kCube, planes.n_domain, planes.offsets.size()).centre, 3, 0.5);
  }

  Least run() {
    look_at_children(kCube);
    descent_.run(kCube, [this](int slot) { return enter_child(slot); });
    found_.lower = std::min(found_.lower, found_.best);
    return found_;
  }

 private:
  static constexpr int kCube = 1;  // the slot of the cube itself

  void look_at_children(int slot) {
    descent_.look_at_children(slot, limits_, kNoLimit);
    Cell& cell = descent_.cells[slot];
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
    cell.n_children = n;
    found_.n_cells += n;
  }

  // Closes the next child of a cell where it can do no better, or is as far as the search goes; whether it is to be
  // divided.
  bool enter_child(int slot) {
    Cell& cell = descent_.cells[slot];
    const int c = cell.order[cell.next++];
    const Index sure = cell.violated + cell.children[c].certain;
    const Index enough =
        found_.best - std::max(search_.gap, static_cast<Index>(search_.ratio * static_cast<double>(found_.best)));
    const bool is_last = slot >= search_.max_level;
    if (sure >= enough || is_last || found_.n_cells >= search_.max_cells) {
      found_.lower = std::min(found_.lower, sure);
      if (sure < enough && sure < least_open_ && is_last) {
        least_open_ = sure;
        to_centre(cell, step_to_child(slot, c), open_cell_);
        open_cell_[3] = half_edge(slot);
      }
      return false;
    }
    Cell& child = descent_.narrow(slot, c);
    child.violated = sure;
    to_centre(cell, step_to_child(slot, c), child.centre);
    look_at_children(slot + 1);
    return true;
  }

  static void to_centre(const Cell& cell, Step step, double* centre) {
    centre[0] = cell.centre[0] + step.x;
    centre[1] = cell.centre[1] + step.y;
    centre[2] = cell.centre[2] + step.z;
  }

  Descent<Cell, true, true> descent_;
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
// a centre may move later. Children are visited in the order of what their centre violates, so that a good point is
// found early. `lower` is certain; it is further below than asked for when cells of `max_level` stay open or
// `max_cells` have been looked at. `open_cell` is then centre and half edge of the least violated cell of `max_level`.
Least least_violated(const CubePlanes& planes, double blur, Index best, const Search& search, double* center,
                     double* open_cell, Stop& stop) {
  return CenterSearch(planes, blur, best, search, center, open_cell, stop).run();
}

}  // namespace voxkernel
