// Cells are cubes of the unit cube; planes, values and reaches are those of plane_list.h. In a cell with half edge h,
// s = value and r = h * reach: s > r proves that the whole cell violates the plane, s < -r that none of it does.
// `reach` is |a|_1 plus the bound on all rounding over the half edge of a voxel, so both are certain at every
// level. Weights are integers: their sums are exact, in whatever order they are made.
//
// Planes of the domain come first in every list and have no weight: one that is violated for certain puts a
// cell outside.
//
// Several thresholds are handled at once. Threshold k is settled in a cell when more than outs[k] is violated
// for certain (outside), or at most ins[k] can be (inside); both are increasing, so the unsettled ones are a range.
#include "relaxed.h"

#include <utility>

#include "brick_sums.h"
#include "plane_list.h"

namespace voxkernel {
namespace {

constexpr Index kOutside = Index{1} << 62;  // more than all weights together

// A cell whose children are open, its lists of domain and facet planes, and what is known of the children.
struct Cell {
  Index ijk[3];
  Index begin, middle, end;
  Index violated;
  Index k_low, k_high;
  int next;  // child
  Side sides[8];
  Weights children[8];
};

class RelaxedOctree {
 public:
  RelaxedOctree(const Thresholds& thresholds, Index n_planes, int depth, int stop_level, bool count_only, Stop& stop)
      : thresholds_(thresholds),
        planes_(3 * n_planes + 1024),
        cells_(depth + 3),
        depth_(depth),
        stop_level_(stop_level),
        count_only_(count_only),
        stop_(stop) {
    found_.n_inside.resize(thresholds.ins.size());
    found_.n_boundary.resize(thresholds.ins.size());
  }

  RelaxedCells run(const CellPlanes& planes, const StartCell& start) {
    take(planes);
    // Slot l + 1 is a cell of level l; slot 0 has one child, the cube.
    const int lowest = start.level + 1;
    Cell& root = cells_[lowest];
    std::copy_n(start.ijk, 3, root.ijk);
    root.middle = planes.n_domain;
    root.end = planes.weights.size();
    root.violated = start.certain;
    root.k_low = start.k_low;
    root.k_high = start.k_high;
    look_at_children(lowest);
    for (int slot = lowest; slot >= lowest;) {
      if (cells_[slot].next == 8) {
        --slot;
      } else if (enter_child(slot)) {
        look_at_children(++slot);
      }
    }
    return std::move(found_);
  }

 private:
  void take(const CellPlanes& planes) {
    const PlaneView p = planes_.view();
    for (Index i = 0; i < planes.weights.size(); ++i) {
      const double* row = planes.numbers[i];
      p.x[i] = row[0];
      p.y[i] = row[1];
      p.z[i] = row[2];
      p.reach[i] = row[3];
      p.value[i] = row[4];
      p.weight[i] = planes.weights[i];
    }
  }

  void look_at_children(int slot) {
    Cell& cell = cells_[slot];
    voxkernel::look_at_children(cell, planes_.view(), slot, thresholds_.outs[cell.k_high - 1] - cell.violated, stop_);
  }

  // Settles the next child of a cell as far as it can be; whether it is to be divided and has become the next cell.
  bool enter_child(int slot) {
    Cell& cell = cells_[slot];
    const int level = slot, c = cell.next;
    cell.next = slot == 0 ? 8 : c + 1;
    if (cell.sides[c] == Side::outside) return false;
    Index k_low = cell.k_low, k_high = cell.k_high;
    const Index certain = cell.violated + cell.children[c].certain,
                possible = cell.violated + cell.children[c].possible;
    if (certain > thresholds_.outs[k_high - 1]) return false;
    while (certain > thresholds_.outs[k_low]) ++k_low;
    Index ijk[3] = {0, 0, 0};
    if (slot > 0) child_cell(cell.ijk, c, ijk);
    while (cell.sides[c] == Side::inside && k_high > k_low && possible <= thresholds_.ins[k_high - 1]) {
      --k_high;
      found_.n_inside[k_high] += Index{1} << (3 * (depth_ - level));
      if (!count_only_) add_tile(ijk, depth_ - level, k_high);
    }
    if (k_low == k_high) return false;
    const Step step = slot == 0 ? step_to_cube() : step_to_child(c, half_edge(level));
    stop_.poll(cell.end - cell.begin);
    planes_.reserve(cell.end + (cell.end - cell.begin));
    const PlaneView p = planes_.view();
    const Index middle = keep_crossing(p, cell.begin, cell.middle, cell.end, step);
    const Index end = keep_crossing(p, cell.middle, cell.end, middle, step);
    Cell& child = cells_[slot + 1];
    child.begin = cell.end;
    child.middle = middle;
    child.end = end;
    child.violated = certain;
    child.k_low = k_low;
    child.k_high = k_high;
    child.next = 0;
    std::copy_n(ijk, 3, child.ijk);
    if (level == stop_level_) {
      list_pending(child);
    } else if (level < depth_ - 3) {
      return true;
    } else {
      settle_brick(child);
    }
    return false;
  }

  void settle_brick(const Cell& brick) {
    const double half = half_edge(depth_);
    const PlaneView p = planes_.view();
    stop_.poll(32 * (brick.end - brick.begin) + 512);
    fill_sums(p, brick.middle, brick.end, half, brick.violated, sums_);
    if (brick.middle > brick.begin) {
      fill_sums(p, brick.begin, brick.middle, half, 0, domain_sums_);
      leave_outside();
    }
    for (Index k = brick.k_low; k < brick.k_high; ++k) {
      Word inside[8], boundary[8];
      const Content content = fill_masks(sums_, thresholds_.ins[k], thresholds_.outs[k], inside, boundary);
      for (int x = 0; x < 8; ++x) {
        found_.n_inside[k] += ones(inside[x]);
        found_.n_boundary[k] += ones(boundary[x]);
      }
      if (count_only_ || content == Content::nothing) continue;
      if (content == Content::everything) {
        add_tile(brick.ijk, 3, k);
        continue;
      }
      found_.leaves.add(brick.ijk, inside, boundary);
      found_.leaf_of.push_back(static_cast<std::int32_t>(k));
    }
  }

  // Voxels that cross a domain plane are undecided at best, those beyond one outside.
  void leave_outside() {
    for (int c = 0; c < 512; ++c) {
      sums_.low[c] = domain_sums_.low[c] > 0 ? kOutside : sums_.low[c];
      sums_.high[c] = domain_sums_.high[c] > 0 ? kOutside : sums_.high[c];
    }
  }

  void add_tile(const Index* ijk, int exponent, Index k) {
    found_.tiles.add(ijk, exponent);
    found_.tile_of.push_back(static_cast<std::int32_t>(k));
  }

  void list_pending(const Cell& cell) {
    const Index listed = static_cast<Index>(found_.pending_weights.size());
    const Index row[9] = {cell.ijk[0],
                          cell.ijk[1],
                          cell.ijk[2],
                          listed,
                          listed + cell.middle - cell.begin,
                          listed + cell.end - cell.begin,
                          cell.violated,
                          cell.k_low,
                          cell.k_high};
    found_.pending.insert(found_.pending.end(), row, row + 9);
    const PlaneView p = planes_.view();
    for (Index t = cell.begin; t < cell.end; ++t) {
      const double numbers[5] = {p.x[t], p.y[t], p.z[t], p.reach[t], p.value[t]};
      found_.pending_numbers.insert(found_.pending_numbers.end(), numbers, numbers + 5);
      found_.pending_weights.push_back(p.weight[t]);
    }
  }

  const Thresholds& thresholds_;
  PlaneList planes_;
  std::vector<Cell> cells_;
  BrickSums sums_{}, domain_sums_{};
  RelaxedCells found_;
  int depth_;
  int stop_level_;
  bool count_only_;
  Stop& stop_;
};

}  // namespace

// Classifies the unit cube, or one cell of it, down to 2**depth voxels an edge for every threshold. Cells still
// unsettled at `stop_level` are listed, not divided (none with stop_level >= depth). With `count_only` nothing is
// listed but counts.
RelaxedCells relaxed_cells(const CellPlanes& planes, const Thresholds& thresholds, int depth, const StartCell& start,
                           int stop_level, bool count_only, Stop& stop) {
  return RelaxedOctree(thresholds, planes.weights.size(), depth, stop_level, count_only, stop).run(planes, start);
}

}  // namespace voxkernel
