// The deepest point of a working set of half-spaces, by a dual simplex.
#pragma once

#include <array>

#include "columns.h"
#include "spans.h"
#include "stop.h"

namespace voxkernel {

// Half-spaces n . x <= d, column by column, each with a bound on the errors of its normal and its offset.
struct HalfSpaceColumns {
  explicit HalfSpaceColumns(Index most) : x(most), y(most), z(most), offset(most), error(most) {}
  void reserve(Index most) {
    for (Column<double>* column : {&x, &y, &z, &offset, &error}) column->reserve(most);
  }
  void push(const double* normal, double d, double e) {
    x[size] = normal[0];
    y[size] = normal[1];
    z[size] = normal[2];
    offset[size] = d;
    error[size++] = e;
  }
  double slack(Index i, const double* p) const { return offset[i] - (x[i] * p[0] + y[i] * p[1] + z[i] * p[2]); }

  Index size = 0;
  Column<double> x, y, z, offset, error;
};

// Maximises t with n . x + t <= d for all half-spaces, |x|_inf <= box, t <= 2 box.
class DeepestPoint {
 public:
  // Constraints 0 .. 5 are the box, 6 caps t, the half-spaces follow.
  static constexpr Index kFirst = 7;
  static constexpr std::array<Index, 4> kCorner{1, 3, 5, 6};  // where all is largest

  // Starts at `basis` where its multipliers are not negative, else at the corner of the box, and says what holds the
  // maximum. Returns the number of steps, negative when they ran out or a basis was singular.
  Index find(const HalfSpaceColumns& planes, double box, double tolerance, Index max_steps, Stop& stop);

  std::array<Index, 4> basis = kCorner;  // the constraints that hold the maximum
  std::array<double, 4> multipliers{};
  std::array<double, 4> point{};  // x and t

 private:
  double row(Index constraint, double* out) const;
  bool is_dual_feasible() const;
  Index entering(double tolerance, bool first_will_do) const;
  int leaving(const double* direction) const;

  const HalfSpaceColumns* planes_ = nullptr;
  double box_ = 0.0;
};

// The same for half-spaces `rows` of many; `basis`, `multipliers` and `point` = (x, t) are read and written.
Index deepest_point(Points normals, Doubles offsets, Indices rows, double box, Span<Index> basis,
                    Span<double> multipliers, Span<double> point, double tolerance, Index max_steps, Stop& stop);

}  // namespace voxkernel
