// The facets that open cells may cross, from the unit cube down. Long lists hold numbers of facets, whose planes are
// put into the cube a block at a time, and which of the eight children each may cross: five bytes a facet. Short ones
// hold the planes themselves (plane_list.h), which are quicker to look at.
#pragma once

#include <algorithm>
#include <cstdint>

#include "columns.h"
#include "plane_list.h"
#include "spans.h"
#include "stop.h"

namespace voxkernel {

// From the frame that planes are held in to the unit cube: normals are turned by `axes`, offsets scaled and moved
// `along` the turned normals, errors made pads.
struct CubeFrame {
  double axes[9];
  double along[3];
  double scale, error_factor, least_pad;

  // From fifteen numbers in this order.
  explicit CubeFrame(const double* numbers) : scale(numbers[12]), error_factor(numbers[13]), least_pad(numbers[14]) {
    std::copy_n(numbers, 9, axes);
    std::copy_n(numbers + 9, 3, along);
  }
};

// Planes in their own frame.
struct FramedPlanes {
  Points normals;
  Doubles offsets, errors;
  Indices weights;
  CubeFrame frame;
};

class FacetLists {
 public:
  // The list of a cell. Lists lie like on a stack: that of a child behind that of its parent, if both are of a kind.
  struct List {
    enum class Kind { all, numbers, planes };
    Index begin = 0, end = 0;
    Kind kind = Kind::all;
    bool knows_children = false;
    Index size() const { return end - begin; }
  };

  explicit FacetLists(const FramedPlanes& facets);

  // That of the cube.
  List all();
  // Weights of the eight children, as far as `wanted`, of the cell with this centre; h is their half edge.
  void weigh_children(const List& list, const double* centre, double h, int wanted, const CentreLimits& limits,
                      Weights (&children)[8], Stop& stop);
  // How many planes are looked at, about, to make the list of a child from that of its parent, and what that of
  // long lists costs later.
  static Index work_of(const List& parent, const List& child) {
    const bool is_from_long = parent.kind != List::Kind::planes, is_long = child.kind != List::Kind::planes;
    return parent.size() + (is_long ? 12 : is_from_long ? 4 : 0) * child.size();
  }
  // Those of the cell that child c may cross; `to` is the centre of the child.
  List narrow(List& list, const double* centre, int c, double h, const double* to, Stop& stop);

 private:
  // Numbers of facets, or all from a first one on.
  struct Numbers {
    const std::uint32_t* ids;
    Index first;
    Index operator[](Index i) const { return ids == nullptr ? first + i : static_cast<Index>(ids[i]); }
  };

  Numbers numbers_of(const List& list, Index begin) const;
  void find_children(List& list, const double* centre, double h, Stop& stop);
  void put_into_cube(const Numbers& numbers, Index n, const double* centre, const PlaneView& planes) const;

  FramedPlanes facets_;
  Index most_planes_;  // of a short list
  Column<std::uint32_t> ids_;
  Column<std::uint8_t> children_, children_of_all_;  // bit c: whether child c may be crossed
  PlaneList<true, true> planes_, block_;
};

}  // namespace voxkernel
