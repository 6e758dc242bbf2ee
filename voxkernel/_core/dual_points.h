// Half-spaces around a point as points n / s, s = d - n . centre, and on which side of their planes others lie.
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "exact_planes.h"
#include "pages.h"
#include "spans.h"
#include "stop.h"

namespace voxkernel {

// Half-spaces n . x <= d in a local frame, rounded, and where they come from exactly. The error of n . x - d at x is at
// most errors (|x| + 1). `center` is the exact centre, rounded to the local frame, off by at most `center_error`.
struct LocalPlanes {
  Points normals;
  Doubles offsets;
  Doubles errors;
  const double* center;
  double center_error;
  double scale;  // local units are this long
};

struct DualPoint {
  double q[3];
  double error;  // of each coordinate
};

// Points that are near each other have places that are. The last six are the sides of a cube about the centre.
struct DualPoints {
  Brief<std::int32_t> rows;   // of each place
  Brief<std::uint32_t> keys;  // ascending, the same for points of one cell of directions; none of few points
  Brief<DualPoint> points;

  std::int32_t size() const { return static_cast<std::int32_t>(rows.size()); }
};

constexpr int kKeyBits = 23;          // the side of a cube of directions, and a cell of 1024 x 1024 on it
constexpr std::int32_t kSorted = 64;  // so few points stay as they come

void sort_rows(const LocalPlanes& planes, Indices rows, DualPoints& found, int threads, Stop& stop);
// Makes dual points, the same whenever asked. One for each thread.
class PointMaker {
 public:
  PointMaker(const LocalPlanes& planes, const DualPoints& duals, const PlaneLattice& lattice);
  // False where the centre is not strictly inside the half-space of a place.
  bool make(std::int32_t place, DualPoint& point);

 private:
  const LocalPlanes& planes_;
  const DualPoints& duals_;
  ExactPlanes exact_;
  double reach_;
};

// False where the centre is not strictly inside all half-spaces.
bool find_points(const LocalPlanes& planes, const PlaneLattice& lattice, DualPoints& found, int threads, Stop& stop);

// The sign of the determinant of three points, 2 where floating point cannot tell.
int rounded_side(const DualPoint& a, const DualPoint& b, const DualPoint& c);

// Signs of determinants of dual points: in floating point where a bound on the error allows, else in integers made
// from the input. One for each thread.
class DualSigns {
 public:
  DualSigns(const DualPoints& duals, const PlaneLattice& lattice) : exact(lattice), points_(duals.points.data()) {}

  // 1 if point l is beyond the plane of i, j, k, seen from the centre; 0 on it.
  int beyond(std::int32_t i, std::int32_t j, std::int32_t k, std::int32_t l);
  // The sign of the determinant of three points, 2 where floating point cannot tell.
  int rounded_side(std::int32_t i, std::int32_t j, std::int32_t k) const {
    return voxkernel::rounded_side(points_[i], points_[j], points_[k]);
  }
  int side(std::int32_t i, std::int32_t j, std::int32_t k);

  ExactPlanes exact;

 private:
  const DualPoint* points_;
};

inline double size_of(const double* v) { return std::abs(v[0]) + std::abs(v[1]) + std::abs(v[2]); }

inline double determinant(const double* u, const double* v, const double* w) {
  return u[0] * (v[1] * w[2] - v[2] * w[1]) + u[1] * (v[2] * w[0] - v[0] * w[2]) + u[2] * (v[0] * w[1] - v[1] * w[0]);
}

}  // namespace voxkernel
