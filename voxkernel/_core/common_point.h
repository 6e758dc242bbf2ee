// The common point of three planes with twice the digits of doubles, and a bound on its error.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "double_double.h"
#include "exact_planes.h"
#include "spans.h"

namespace voxkernel {

class CommonPoints {
 public:
  // `scale`, a power of two, is the unit of points.
  CommonPoints(const PlaneSource& source, Span<const std::int32_t> rows, double scale)
      : source_(source), rows_(rows), exponent_(std::ilogb(scale)), to_unit_(-exponent_) {
    std::size_t size = 16;
    while (size < kCached && size < static_cast<std::size_t>(rows.size())) size *= 2;
    cache_.resize(size);
  }

  // Of the planes at three positions in `rows`, from the centre. Returns a bound on the error of each
  // coordinate; infinity where there is none.
  double find(Index i, Index j, Index k, double* point);

 private:
  // n . y <= s about the centre, n not far from 1; n and s, each number of n, are off by less than the errors.
  struct Plane {
    Index place = -1;
    DoubleDouble n[3], s;
    double n_size = 0.0;  // 1-norm
    double n_error = 0.0, s_error = 0.0;
  };
  static constexpr std::size_t kCached = 1024;
  const Plane& plane(Index place);
  void from_corners(const Index* corners, Plane& plane) const;
  void from_given(const double* row, Plane& plane) const;

  PlaneSource source_;
  Span<const std::int32_t> rows_;
  int exponent_;  // of the unit
  Shift to_unit_;
  std::vector<Plane> cache_;  // by place, the last one asked for; a power of two of them
};

}  // namespace voxkernel
