// Polygons in space: one plane for each planar one, and triangles for all, in the order of the input.
#pragma once

#include <array>
#include <vector>

#include "growing_array.h"
#include "polygon_spread.h"
#include "scaling.h"
#include "spans.h"
#include "stop.h"
#include "unfilled.h"

namespace voxkernel {

// A polygon that has no fan which keeps its side, and where its parts are; `plane` is -1 where it is planar.
struct Unfanned {
  Index polygon, corner, triangle, plane;
  std::array<double, 3> newell;  // its area vector
};

class PolygonCuts {
 public:
  // Polygons of at least three corners, `sizes` of them in `flat`; planar is what deviates by at most `rtol` of the
  // diameter. Areas are in the units of the points; those of triangles that were not planar together stay negative.
  PolygonCuts(Points points, Indices flat, Indices sizes, int exponent, double rtol, Stop& stop);

  UnfilledVector<Index> triangles, facet_ids;
  GrowingArray<Index> plane_corners, plane_facets, nonplanar;
  GrowingArray<double> plane_areas;
  std::vector<Unfanned> unfanned;  // cut into the fan of the first corner

 private:
  void add(Index polygon, Indices ring, double rtol, Stop& stop);
  void load(Indices ring);
  bool cut_into_fan(Indices ring, const std::array<double, 3>& newell);
  void write_fan(Indices ring, Index apex);
  void push_plane(Index a, Index b, Index c, Index facet, double area);
  double area_of(const std::array<double, 3>& newell) const;

  Points points_;
  Scaling scaled_;
  int exponent_;
  Index n_triangles_ = 0;
  std::vector<double> x_, y_, z_;  // a polygon relative to its first corner, twice
};

// Fills the areas that are negative with those of the triangles of the planes' corners.
void fill_triangle_areas(Points points, Triangles corners, int exponent, Span<double> areas, Stop& stop);

}  // namespace voxkernel
