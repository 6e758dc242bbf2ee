// Planes as integers, and the signs of determinants of them.
#pragma once

#include <cstdint>
#include <mutex>
#include <unordered_map>

#include "spans.h"
#include "wide_integer.h"

namespace voxkernel {

// Where exact planes come from: three corners each, or, where the first of `corners` is -1 - j, plane j of `given`
// (n and d of n . x <= d). `center` holds doubles whose sum is the centre.
struct PlaneSource {
  Points vertices;
  Triangles corners;
  Rows<const double, 4> given;
  Points center;
};

// The planes of some rows, and the coarsest lattice that holds the centre and every corner in use: short numbers are
// quick ones. It is found when first asked for, once for all threads.
class PlaneLattice {
 public:
  PlaneLattice(const PlaneSource& source, Span<const std::int32_t> rows, int cube_exponent)
      : source(source), rows(rows), cube_exponent(cube_exponent) {}

  // Every number in use times 2**shift is an integer.
  int shift() const {
    std::call_once(is_found_, [this] { shift_ = -lowest(); });
    return shift_;
  }

  const PlaneSource source;
  const Span<const std::int32_t> rows;
  const int cube_exponent;

 private:
  int lowest() const;

  mutable std::once_flag is_found_;
  mutable int shift_ = 0;
};

// Half-spaces n . y <= s as integers, y the exact distance from the centre in units of a lattice that holds all
// corners.
//
// Planes are made when they are asked for, and some thousand of them kept. Indices are positions in `rows`; the six
// after the last are the sides of a cube about the centre, x, -x, y, -y, z, -z.
class ExactPlanes {
 public:
  explicit ExactPlanes(const PlaneLattice& lattice);

  // The sign of the determinant of three normals.
  int normals_sign(Index i, Index j, Index k);
  // The sign of the determinant of four rows (n, s).
  int planes_sign(Index i, Index j, Index k, Index l);
  // Whether two half-spaces that hold the centre strictly are the same.
  bool are_same(Index i, Index j);
  // The sign of s: 1 where the half-space holds the centre strictly.
  int slack_sign(Index i);
  // n / s in units of 1 / `scale`, each number off by less than 2**-49 of itself.
  void dual(Index i, double scale, double* q);
  // The common point of three planes, from the centre, in units of `scale`; the same accuracy.
  void common_point(Index i, Index j, Index k, double scale, double* point);

 private:
  struct Plane {
    Wide n[3];
    Wide s;
  };
  static constexpr std::size_t kMost = 4096;
  void find_center();
  bool have_common_corner(Index i, Index j, Index k, Index l) const;
  const Plane& plane(Index i);
  Wide keep(const Wide& value, LimbPool& pool);
  void forget();
  void from_corners(const Index* corners, Plane& plane);
  void from_given(const double* row, Plane& plane);
  Wide determinant(const Wide& ab, const Wide& ac, const Wide& bc, const Wide& a, const Wide& b, const Wide& c);

  const PlaneLattice& lattice_;
  PlaneSource source_;
  Span<const std::int32_t> rows_;
  int shift_ = 0;
  bool has_center_ = false;
  Wide center_[3];
  std::unordered_map<Index, Plane> planes_;
  LimbPool own_, kept_, scratch_;  // of the centre, of planes, of one answer
};

}  // namespace voxkernel
