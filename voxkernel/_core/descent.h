// What the octrees and the search for a centre share: the open cells from the cube down to one, depth first, each with
// the planes that it may cross behind those of its parent.
//
// Slot l + 1 holds the open cell of level l; slot 0 stands above the cube, which is its one child. Each octree decides
// what becomes of a child and what is handed out; bounds are those of plane_bounds.h.
#pragma once

#include <vector>

#include "plane_list.h"
#include "spans.h"
#include "stop.h"
#include "voxels.h"

namespace voxkernel {

// Half the edge of the children of the cell in a slot.
inline double half_edge(int slot) { return 0.5 / static_cast<double>(Index{1} << slot); }
inline Step step_to_cube() { return {0.0, 0.0, 0.0, 0.5}; }
inline Step step_to_child(int slot, int c) { return slot == 0 ? step_to_cube() : child_step(c, half_edge(slot)); }

// A cell whose children are open: its planes begin .. end, those before `middle` a domain's, and the child to go on
// with.
struct OpenCell {
  Index ijk[3] = {0, 0, 0};
  Index begin = 0, middle = 0, end = 0;
  int next = 0, n_children = 0;
};

// One that counts weights: what all of it violates, and what is known of its children beside that.
struct WeighedCell : OpenCell {
  Index violated = 0;
  Side sides[8] = {};
  Weights children[8] = {};
};

// The stack of open cells and the list of their planes.
template <typename Cell, bool has_pad, bool has_weight>
class Descent {
 public:
  Descent(Index n_planes, int n_slots, Stop& stop) : planes(3 * n_planes + 1024), cells(n_slots), stop_(stop) {}

  // Goes on from the cell in slot `top` until nothing below it is open. `enter(slot)` settles the next child of the
  // cell in a slot, or makes it the open cell of the next slot and returns true.
  template <typename Enter>
  void run(int top, Enter&& enter) {
    for (int slot = top; slot >= top;) {
      if (cells[slot].next == cells[slot].n_children) {
        --slot;
      } else if (enter(slot)) {
        ++slot;
      }
    }
  }

  // The first open cell: all planes are its.
  Cell& open_first(int slot, Index n_domain, Index n_planes) {
    Cell& cell = cells[slot];
    cell.middle = n_domain;
    cell.end = n_planes;
    cell.n_children = slot == 0 ? 1 : 8;
    return cell;
  }

  // Fills sides and weights of the children of a cell. A child that violates more than `most` for certain is not
  // looked at to the end.
  template <typename Limits>
  void look_at_children(int slot, const Limits& limits, Index most) {
    Cell& cell = cells[slot];
    const PlaneView p = planes.view();
    stop_.poll(8 * (cell.end - cell.begin) + 8);
    if (slot == 0) {
      const Step step = step_to_cube();
      cell.sides[0] = domain_side(p, cell.begin, cell.middle, step, limits);
      cell.children[0] = weights_of(p, cell.middle, cell.end, step, limits);
      return;
    }
    const double h = half_edge(slot);
    int wanted = 0;
    for (int c = 0; c < 8; ++c) {
      cell.sides[c] = domain_side(p, cell.begin, cell.middle, child_step(c, h), limits);
      if (cell.sides[c] != Side::outside) wanted |= 1 << c;
    }
    weights_of_children(p, cell.middle, cell.end, h, most, wanted, limits, cell.children);
  }

  // The list, with room for as many planes as a cell has behind these.
  PlaneView with_room_for(const OpenCell& cell) {
    stop_.poll(16 + cell.end - cell.begin);
    planes.reserve(cell.end + (cell.end - cell.begin));
    return planes.view();
  }

  // Child c of the cell in a slot, in the next slot; its list follows that of the cell and is still to be written.
  Cell& open_child(int slot, int c) {
    const Cell& cell = cells[slot];
    Cell& child = cells[slot + 1];
    child_cell(cell.ijk, c, child.ijk);
    child.begin = cell.end;
    child.next = 0;
    child.n_children = 8;
    return child;
  }

  // The same, with those planes of the cell that the child may cross.
  Cell& narrow(int slot, int c) {
    const Cell& cell = cells[slot];
    const Step step = step_to_child(slot, c);
    const PlaneView p = with_room_for(cell);
    Cell& child = open_child(slot, c);
    child.middle = keep_crossing<has_pad>(p, cell.begin, cell.middle, cell.end, step);
    child.end = keep_crossing<has_pad>(p, cell.middle, cell.end, child.middle, step);
    return child;
  }

  PlaneList<has_pad, has_weight> planes;
  std::vector<Cell> cells;

 private:
  Stop& stop_;
};

// The planes of the unit cube as callers hand them in, the first `n_domain` those of a domain. Without `pads` they are
// a part of `reach`.
struct CubePlanes {
  Points normals;
  Doubles offsets, reach, pads;
  Indices weights;
  Index n_domain;
};

// The first list of an octree.
template <bool has_pad>
void list_planes(const CubePlanes& planes, const PlaneList<has_pad, true>& list) {
  const PlaneView p = list.view();
  for (Index i = 0; i < planes.offsets.size(); ++i) {
    const double* a = planes.normals[i];
    p.set(i, a, planes.reach[i], value_in_cube(a, planes.offsets[i]));
    if constexpr (has_pad) p.pad[i] = planes.pads[i];
    p.weight[i] = planes.weights[i];
  }
}

}  // namespace voxkernel
