// The lists are those of descent.h, as in relaxed.cpp, with pads a part of the reach; the same tests with the same
// numbers, so that the sums over all chunks are those that one list of all planes comes to.
#include "open_weights.h"

#include <algorithm>

#include "brick_sums.h"
#include "descent.h"

namespace voxkernel {
namespace {

constexpr int kBrick = 512;

// A cell on the way down, and the open cells that it holds or lies in.
struct Cell : WeighedCell {
  Index code = 0;
  Index first = 0, last = 0;
};

class OpenWeights {
 public:
  OpenWeights(const OpenCells& open, int below, Index n_planes, Span<Index> sums, Span<Index> bricks, Stop& stop)
      : open_(open),
        below_(below),
        last_level_(open.level + below),
        n_down_(n_cells_down(below)),
        sums_(sums),
        bricks_(bricks),
        descent_(n_planes, last_level_ + 3, stop),
        stop_(stop) {}

  void run(const CellPlanes& planes) {
    const PlaneView p = descent_.planes.view();
    for (Index i = 0; i < planes.weights.size(); ++i) {
      const double* row = planes.numbers[i];
      p.set(i, row, row[3], row[4]);
      p.weight[i] = planes.weights[i];
    }
    Cell& top = descent_.open_first(0, 0, planes.weights.size());
    top.last = open_.codes.size();
    look_at_children(0);
    descent_.run(0, [this](int slot) { return enter_child(slot); });
  }

 private:
  void look_at_children(int slot) { descent_.look_at_children(slot, CellLimits{}, kNoLimit); }

  // Adds what the next child violates; whether to go on below it.
  bool enter_child(int slot) {
    Cell& cell = descent_.cells[slot];
    const int level = slot, c = cell.next++;
    const Index code = slot == 0 ? 0 : 8 * cell.code + c;
    Index first = cell.first, last = cell.last;
    if (level <= open_.level) {
      const int shift = 3 * (open_.level - level);
      const Index* codes = open_.codes.data();
      first = std::lower_bound(codes + first, codes + last, code << shift) - codes;
      last = std::lower_bound(codes + first, codes + last, (code + 1) << shift) - codes;
      if (first == last) return false;
    }
    const Index certain = cell.violated + cell.children[c].certain;
    if (level >= open_.level) add(first, level, code, 1, certain, cell.violated + cell.children[c].possible);
    if (level == last_level_ && bricks_.size() == 0) return false;
    Cell& child = descent_.narrow(slot, c);
    child.violated = certain;
    child.code = code;
    child.first = first;
    child.last = last;
    if (child.begin == child.end) {
      add_everywhere(child, level);
    } else if (level == last_level_) {
      add_brick(child);
    } else {
      look_at_children(slot + 1);
      return true;
    }
    return false;
  }

  // The first of the descendants of an open cell that are `code` and the cells after it.
  Index place(Index row, int level, Index code) const {
    const int depth = level - open_.level;
    return n_down_ * row + (depth == 0 ? 0 : n_cells_down(depth - 1)) + code - (open_.codes[row] << (3 * depth));
  }

  void add(Index row, int level, Index code, Index n, Index certain, Index possible) {
    Index* pair = &sums_[2 * place(row, level, code)];
    for (Index i = 0; i < n; ++i, pair += 2) {
      pair[0] += certain;
      pair[1] += possible;
    }
  }

  // The 1024 sums of a brick.
  Index* brick(Index row, Index code) const {
    const Index local = code - (open_.codes[row] << (3 * below_));
    return &bricks_[2 * kBrick * ((row << (3 * below_)) + local)];
  }

  // No plane crosses the cell: all that lies in it violates the same.
  void add_everywhere(const Cell& cell, int level) {
    if (cell.violated == 0) return;
    for (Index row = cell.first; row < cell.last; ++row) {
      for (int l = std::max(level + 1, open_.level); l <= last_level_; ++l) {
        const bool is_above = level < open_.level;
        const int shift = 3 * (l - (is_above ? open_.level : level));
        add(row, l, (is_above ? open_.codes[row] : cell.code) << shift, Index{1} << shift, cell.violated,
            cell.violated);
      }
      if (bricks_.size() == 0) continue;
      const bool is_above = level < open_.level;
      const int shift = 3 * (last_level_ - (is_above ? open_.level : level));
      Index* const sums = brick(row, (is_above ? open_.codes[row] : cell.code) << shift);
      stop_.poll(Index{128} << shift);
      for (Index i = 0; i < Index{2 * kBrick} << shift; ++i) sums[i] += cell.violated;
    }
  }

  void add_brick(const Cell& cell) {
    stop_.poll(32 * (cell.end - cell.begin) + 512);
    fill_sums(descent_.planes.view(), cell.begin, cell.end, half_edge(last_level_ + 3), cell.violated, brick_sums_);
    Index* const sums = brick(cell.first, cell.code);
    for (int i = 0; i < kBrick; ++i) sums[i] += brick_sums_.low[i];
    for (int i = 0; i < kBrick; ++i) sums[kBrick + i] += brick_sums_.high[i];
  }

  BrickSums brick_sums_{};
  const OpenCells& open_;
  int below_, last_level_;
  Index n_down_;
  Span<Index> sums_, bricks_;
  Descent<Cell, false, true> descent_;
  Stop& stop_;
};

}  // namespace

void add_open_weights(const CellPlanes& planes, const OpenCells& open, int below, Span<Index> sums, Span<Index> bricks,
                      Stop& stop) {
  OpenWeights(open, below, planes.weights.size(), sums, bricks, stop).run(planes);
}

}  // namespace voxkernel
