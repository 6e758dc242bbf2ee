#include "center_cells.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "descent.h"

namespace voxkernel {
namespace {

constexpr int kCube = 1;  // the slot of the cube itself

}  // namespace

void Outcome::add(Outcome&& other) {
  if (std::tie(other.best, other.best_of) < std::tie(best, best_of)) {
    best = other.best;
    best_of = other.best_of;
    std::copy_n(other.center, 3, center);
  }
  if (std::tie(other.least_open, other.open_of) < std::tie(least_open, open_of)) {
    least_open = other.least_open;
    open_of = other.open_of;
    std::copy_n(other.open_cell, 4, open_cell);
  }
  lower = std::min(lower, other.lower);
  n_cells += other.n_cells;
  n_planes += other.n_planes;
  waiting.insert(waiting.end(), other.waiting.begin(), other.waiting.end());
  other.waiting = {};
}

CellDivider::CellDivider(const FramedPlanes& facets, const Border& border, double blur, const Search& search)
    : facets_(facets),
      border_(3 * border.offsets.size() + 1024),
      cells_(static_cast<std::size_t>(search.max_level) + 3),
      limits_{blur},
      search_(search) {
  Cell& cube = cells_[kCube];
  const PlaneView p = border_.view();
  for (Index i = 0; i < border.offsets.size(); ++i) {
    const double* a = border.normals[i];
    p.set(i, a, std::abs(a[0]) + std::abs(a[1]) + std::abs(a[2]), value_in_cube(a, border.offsets[i]));
    p.pad[i] = border.pads[i];
    p.weight[i] = 0;
  }
  cube.border_end = border.offsets.size();
  cube.facets = facets_.all();
}

Index CellDivider::enough(const Search& search, Index best) {
  return best - std::max(search.gap, static_cast<Index>(search.ratio * static_cast<double>(best)));
}

void CellDivider::divide(const Waiting& cell, Index index, const Path& before, const Round& round, Stop& stop) {
  round_ = &round;
  stop_ = &stop;
  index_ = index;
  best_ = round.best;
  least_open_ = round.least_open;
  const Path path = cell.path();
  const int n_common = at_.common_with(path);
  for (int k = n_common; k < path.n; ++k) open(kCube + k, path.child(k));
  at_ = path;
  // Counted is what one thread alone opens.
  n_cells_ = n_planes_ = 0;
  for (int k = before.common_with(path); k < path.n; ++k)
    n_planes_ += FacetLists::work_of(at(kCube + k).facets, at(kCube + k + 1).facets);
  const int top = kCube + path.n;
  at(top).violated = cell.sure;
  look_at_children(top);
  for (int slot = top; slot >= top;) {
    const Cell& here = at(slot);
    if (here.next == here.n_children) {
      --slot;
    } else if (enter_child(slot)) {
      ++slot;
    }
  }
  outcome_.n_cells += n_cells_;
  outcome_.n_planes += n_planes_;
}

void CellDivider::to_centre(const Cell& cell, const Step& step, double* centre) {
  centre[0] = cell.centre[0] + step.x;
  centre[1] = cell.centre[1] + step.y;
  centre[2] = cell.centre[2] + step.z;
}

// Child c of the cell in a slot, in the next slot.
void CellDivider::open(int slot, int c) {
  Cell& cell = at(slot);
  Cell& child = at(slot + 1);
  const Step step = step_to_child(slot, c);
  child.path = cell.path.then(c);
  to_centre(cell, step, child.centre);
  border_.reserve(cell.border_end + (cell.border_end - cell.border_begin));
  child.border_begin = cell.border_end;
  child.border_end = keep_crossing<true>(border_.view(), cell.border_begin, cell.border_end, child.border_begin, step);
  child.facets = facets_.narrow(cell.facets, cell.centre, c, half_edge(slot), child.centre, *stop_);
}

void CellDivider::look_at_children(int slot) {
  Cell& cell = at(slot);
  const double h = half_edge(slot);
  int wanted = 0;
  for (int c = 0; c < 8; ++c) {
    cell.sides[c] = domain_side(border_.view(), cell.border_begin, cell.border_end, child_step(c, h), limits_);
    if (cell.sides[c] != Side::outside) wanted |= 1 << c;
  }
  facets_.weigh_children(cell.facets, cell.centre, h, wanted, limits_, cell.children, *stop_);
  n_planes_ += 8 * cell.facets.size();
  int n = 0;
  for (int c = 0; c < 8; ++c) {
    if (cell.sides[c] == Side::outside) continue;
    const Index at_centre = cell.children[c].possible;
    if (cell.sides[c] == Side::inside && cell.violated + at_centre < best_) {
      best_ = cell.violated + at_centre;
      if (std::tie(best_, index_) <= std::tie(outcome_.best, outcome_.best_of)) {
        outcome_.best = best_;
        outcome_.best_of = index_;
        to_centre(cell, child_step(c, h), outcome_.center);
      }
    }
    int at = n++;
    for (; at > 0 && cell.children[cell.order[at - 1]].possible > at_centre; --at) cell.order[at] = cell.order[at - 1];
    cell.order[at] = c;
  }
  cell.next = 0;
  cell.n_children = n;
  n_cells_ += n;
}

// Closes the next child of a cell where it can do no better, or is as far as the search goes; whether it is to be
// divided now. Else it waits.
bool CellDivider::enter_child(int slot) {
  Cell& cell = at(slot);
  const bool is_first = cell.next == 0;
  const int c = cell.order[cell.next++];
  const Index sure = cell.violated + cell.children[c].certain;
  const bool is_last = slot >= search_.max_level;
  if (is_closed(sure) || is_last) {
    outcome_.lower = std::min(outcome_.lower, sure);
    if (!is_closed(sure) && sure < least_open_) {
      least_open_ = sure;
      if (std::tie(sure, index_) <= std::tie(outcome_.least_open, outcome_.open_of)) {
        outcome_.least_open = sure;
        outcome_.open_of = index_;
        to_centre(cell, step_to_child(slot, c), outcome_.open_cell);
        outcome_.open_cell[3] = half_edge(slot);
      }
    }
    return false;
  }
  const bool is_now = round_->is_straight ? is_first : sure <= round_->most_taken;
  if (!is_now || is_over()) {
    outcome_.waiting.emplace_back(cell.path.then(c), cell.facets.size(), sure);
    return false;
  }
  open(slot, c);
  n_planes_ += FacetLists::work_of(cell.facets, at(slot + 1).facets);
  at(slot + 1).violated = sure;
  look_at_children(slot + 1);
  return true;
}

}  // namespace voxkernel
