// The lists are those of descent.h, with pads a part of the reach: what is certain in a cell is so by plane_bounds.h.
// Weights are integers: their sums are exact, in whatever order they are made.
//
// Planes of the domain come first in every list and have no weight: one that is violated for certain puts a
// cell outside.
//
// Several thresholds are handled at once. Threshold k is settled in a cell when more than outs[k] is violated
// for certain (outside), or at most ins[k] can be (inside); both are increasing, so the unsettled ones are a range.
#include "relaxed.h"

#include <utility>

#include "brick_sums.h"
#include "descent.h"

namespace voxkernel {
namespace {

constexpr Index kOutside = Index{1} << 62;  // more than all weights together

// A cell whose children are open, and the range of its unsettled thresholds.
struct Cell : WeighedCell {
  Index k_low = 0, k_high = 0;
};

class RelaxedOctree {
 public:
  RelaxedOctree(const Thresholds& thresholds, Index n_planes, int depth, int stop_level, bool count_only, Stop& stop)
      : thresholds_(thresholds),
        descent_(n_planes, depth + 3, stop),
        depth_(depth),
        stop_level_(stop_level),
        count_only_(count_only),
        stop_(stop) {
    found_.n_inside.resize(thresholds.ins.size());
    found_.n_boundary.resize(thresholds.ins.size());
  }

  RelaxedCells run(const CellPlanes& planes, const StartCell& start) {
    take(planes);
    const int top = start.level + 1;
    Cell& cell = descent_.open_first(top, planes.n_domain, planes.weights.size());
    if (top != 0) std::copy_n(start.ijk, 3, cell.ijk);
    cell.violated = start.certain;
    cell.k_low = start.k_low;
    cell.k_high = start.k_high;
    look_at_children(top);
    descent_.run(top, [this](int slot) { return enter_child(slot); });
    return std::move(found_);
  }

 private:
  void take(const CellPlanes& planes) {
    const PlaneView p = descent_.planes.view();
    for (Index i = 0; i < planes.weights.size(); ++i) {
      const double* row = planes.numbers[i];
      p.set(i, row, row[3], row[4]);
      p.weight[i] = planes.weights[i];
    }
  }

  void look_at_children(int slot) {
    const Cell& cell = descent_.cells[slot];
    descent_.look_at_children(slot, CellLimits{}, thresholds_.outs[cell.k_high - 1] - cell.violated);
  }

  // Settles the next child of a cell as far as it can be; whether it is to be divided.
  bool enter_child(int slot) {
    Cell& cell = descent_.cells[slot];
    const int level = slot, c = cell.next++;
    const Index certain = cell.violated + cell.children[c].certain;
    if (cell.sides[c] == Side::outside || certain > thresholds_.outs[cell.k_high - 1]) return false;
    Index k_low = cell.k_low;
    while (certain > thresholds_.outs[k_low]) ++k_low;
    const Index k_high = hand_out_tiles(cell, c, k_low, depth_ - level);
    if (k_low == k_high) return false;
    Cell& child = descent_.narrow(slot, c);
    child.violated = certain;
    child.k_low = k_low;
    child.k_high = k_high;
    if (level == stop_level_) {
      list_pending(child);
    } else if (level < depth_ - 3) {
      look_at_children(slot + 1);
      return true;
    } else {
      settle_brick(child);
    }
    return false;
  }

  // Child c is inside for those thresholds that all of it keeps; where the rest ends.
  Index hand_out_tiles(const Cell& cell, int c, Index k_low, int exponent) {
    Index k_high = cell.k_high;
    if (cell.sides[c] != Side::inside) return k_high;
    const Index possible = cell.violated + cell.children[c].possible;
    Index ijk[3];
    child_cell(cell.ijk, c, ijk);
    while (k_high > k_low && possible <= thresholds_.ins[k_high - 1]) {
      --k_high;
      found_.n_inside[k_high] += Index{1} << (3 * exponent);
      if (!count_only_) add_tile(ijk, exponent, k_high);
    }
    return k_high;
  }

  void settle_brick(const Cell& brick) {
    const double half = half_edge(depth_);
    const PlaneView p = descent_.planes.view();
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
    const PlaneView p = descent_.planes.view();
    for (Index t = cell.begin; t < cell.end; ++t) {
      const double numbers[5] = {p.x[t], p.y[t], p.z[t], p.reach[t], p.value[t]};
      found_.pending_numbers.insert(found_.pending_numbers.end(), numbers, numbers + 5);
      found_.pending_weights.push_back(p.weight[t]);
    }
  }

  BrickSums sums_{}, domain_sums_{};
  const Thresholds& thresholds_;
  Descent<Cell, false, true> descent_;
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
