// One polyhedral cell: its edges, its facet planes as `TriangleMesh.from_polygons` makes them, its volume.
#pragma once

#include <vector>

#include "cell_gather.h"
#include "spans.h"
#include "stop.h"

namespace voxkernel {

// Turned: the faces would fit if some were turned over. Open: some edge has an odd number of them.
enum class Closing { kClosed, kOpen, kTurned };
struct EdgeBalance {
  Closing closing;
  Index n_wrong;  // edges
};

// Whether every edge of a cell is traversed equally often both ways.
class EdgeCheck {
 public:
  explicit EdgeCheck(Index most_corners) : start_(most_corners + 2), fill_(most_corners + 1), keys_(most_corners) {}
  EdgeBalance balance(const Cell& cell);

 private:
  std::vector<Index> start_, fill_, keys_;
};

// Planes of polygons, each given by three corners of the polygon.
class PolygonPlanes {
 public:
  explicit PolygonPlanes(Index most_corners);

  Index n_planes = 0;
  std::vector<Index> corners;   // three a plane
  std::vector<Index> face;      // the polygon it belongs to
  std::vector<double> extra;    // by how much the plane, |x| + 1 away, depends on which corners define it
  std::vector<char> is_planar;  // of each face: it has one plane

  // Sets the planes of all faces and the apex of each, as `TriangleMesh.from_polygons` would; false where that is not
  // sure (near its thresholds, and for polygons it cuts by ear clipping) and where there are more planes than `most`.
  bool set(Cell& cell, double rtol, Index most, Stop& stop);

 private:
  bool add(Points points, Indices ring, double rtol, Index& apex, Stop& stop);
  bool add_fan(Points points, Indices ring, const double* sum, Index& apex);
  void push(Index a, Index b, Index c, double off);

  std::vector<double> x_, y_, z_;  // a polygon relative to its first corner, twice
};

// Six times the volume enclosed by fans, and a bound on its error, for |x| <= 1; volume from the origin.
struct Bounded {
  double value, doubt;
};
Bounded fan_volume(Points points, const Polygons& polygons);
// Area of all triangles of the fans: at least that of the surface.
double fan_area(Points points, const Polygons& polygons);
// Signed solid angle of all fans seen from `center` (van Oosterom and Strackee 1983).
double solid_angle(Points points, const Polygons& polygons, const double* center);
// Largest squared distance of two points.
double squared_diameter(Points points, Stop& stop);

}  // namespace voxkernel
