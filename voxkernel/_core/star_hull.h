// The body of half-spaces q . x <= 1 about the origin: the hull of the points q, in floating point, checked afterwards.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "spans.h"

namespace voxkernel {

// One body after the other; the memory is used again.
class StarHull {
 public:
  using Nearby = std::vector<std::array<std::int32_t, 3>>;

  // Bodies lie in the cube of half edge 2.
  void clear();
  void push(double x, double y, double z);

  // Volume and box of the body, off by ten times `share` of themselves at most; false where that is not certain.
  // `nearby` names, for each point in the order they were pushed, three others that are likely to be near it; it may be
  // left empty.
  bool measure(double share, const Nearby& nearby, double* volume, double* box);

 private:
  struct Point {
    double x, y, z;
  };
  // The plane n . q = 1, which is a corner of the body; `across[k]` is the triangle across the edge opposite corner k,
  // from corner k + 1 to k + 2. Spare ones have no corners: -1.
  struct Triangle {
    Point n;
    std::int32_t corner[3];
    std::int32_t across[3];
    std::int32_t mark;  // when it was seen last
  };
  // Of a triangle beyond the point, of the hull, or, with the triangle itself for `back`, one still to be looked at.
  struct Edge {
    std::int32_t from, to, outside, back;
  };

  void begin();
  bool make(double spread, double share, const Nearby& nearby);
  void sort_by_distance(double spread);
  bool insert(std::int32_t point, std::int32_t hint);
  std::int32_t first_beyond(const Point& q, double limit) const;
  void clear_triangle(std::int32_t at);
  std::int32_t seed_for(const Point& q, std::int32_t hint) const;
  std::int32_t locate(const Point& q, std::int32_t hint) const;
  bool trace(std::int32_t seed, const Point& q);
  std::int32_t hint_for(std::int32_t point, const Nearby& nearby) const;
  bool plane_of(const Point& a, const Point& b, const Point& c, Point* n);
  void list_edges();
  bool is_right(double share, const Nearby& nearby);
  bool is_convex(double share, const Nearby& nearby) const;
  bool is_corner(std::int32_t point) const;
  bool has_none_beyond(double share) const;
  double volume();

  std::vector<Point> points_;  // the first six are the sides of the cube
  std::vector<Triangle> triangles_;
  std::vector<double> nx_, ny_, nz_;  // the planes of all triangles once more; those of spare ones are 0
  std::vector<std::uint64_t> order_;  // points, the farthest first
  std::vector<std::int32_t> free_, seen_, slots_;
  std::vector<std::int32_t> stamps_;  // when points came to be on the border
  std::vector<Edge> horizon_, open_, edges_;
  std::vector<Point> planes_, feet_;
  std::vector<double> rests_;  // how far the plane of each triangle misses its corners
  std::int32_t stamp_ = 0, last_ = 0, n_seen_ = 0, n_border_ = 0;
  double excess_ = 0.0;     // how far the point is beyond the triangles that it sees
  double farthest_ = 0.0;   // largest square of a point
  double least_ = 0.0;      // what a triangle that certainly turns about the origin has at least
  bool is_turned_ = false;  // all triangles had that
};

}  // namespace voxkernel
