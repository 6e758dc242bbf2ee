// The body of half-spaces q . x <= 1 about the origin: the hull of the points q, in floating point, checked afterwards.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "spans.h"

namespace voxkernel {

// One body after the other; the memory is used again.
class StarHull {
 public:
  // Bodies lie in the cube of half edge 2.
  void clear();
  void push(double x, double y, double z);

  // Volume and box of the body, off by ten times `share` of themselves at most; false where that is not certain.
  bool measure(double share, double* volume, double* box);

 private:
  struct Triangle {
    std::int32_t corner[3];
    std::int32_t across[3];  // the triangle across the edge opposite corner k; its corners k + 1 and k + 2
  };
  struct Edge {
    std::int32_t from, to, outside, back;
  };

  void begin();
  bool insert(std::int32_t point);
  bool place(std::int32_t at, std::int32_t a, std::int32_t b, std::int32_t c);
  bool is_right(double share) const;
  double volume() const;

  std::vector<double> x_, y_, z_;     // the points; the first six are the sides of the cube
  std::vector<double> nx_, ny_, nz_;  // the plane n . q = 1 of every triangle, which is a corner of the body; 0: none
  std::vector<Triangle> triangles_;
  std::vector<std::pair<double, std::int32_t>> order_;  // points, the farthest first
  std::vector<std::int32_t> free_, seen_, fresh_, slots_;
  std::vector<std::int32_t> marks_, stamps_;  // when triangles were seen last, and points came to be on the border
  std::vector<Edge> horizon_;
  std::int32_t stamp_ = 0;
};

}  // namespace voxkernel
