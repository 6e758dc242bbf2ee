// The deepest point of a few half-spaces, by a dual simplex.
#pragma once

#include <array>
#include <vector>

#include "spans.h"
#include "stop.h"

namespace voxkernel {

// Half-spaces n . x <= d, column by column, each with a bound on the errors of its normal and its offset.
struct HalfSpaceColumns {
  explicit HalfSpaceColumns(Index most) : x(most), y(most), z(most), offset(most), error(most) {}
  void push(const double* normal, double d, double e) {
    x[size] = normal[0];
    y[size] = normal[1];
    z[size] = normal[2];
    offset[size] = d;
    error[size++] = e;
  }
  double slack(Index i, const double* p) const { return offset[i] - (x[i] * p[0] + y[i] * p[1] + z[i] * p[2]); }

  Index size = 0;
  std::vector<double> x, y, z, offset, error;
};

// Maximises t with n . x + t <= d for all half-spaces, |x|_inf <= box, t <= 2 box.
class DeepestPoint {
 public:
  // Constraints 0 .. 5 are the box, 6 caps t, the half-spaces follow.
  static constexpr Index kFirst = 7;

  explicit DeepestPoint(Index most) : violations_(most) {}

  // Starts at the corner of the box and returns whether the maximum was found.
  bool find(const HalfSpaceColumns& planes, double box, double tolerance, int max_steps, Stop& stop);

  std::array<Index, 4> basis{};  // the constraints that hold the maximum
  std::array<double, 4> multipliers{};
  std::array<double, 4> point{};  // x and t

 private:
  double row(Index constraint, double* out) const;
  Index entering(double tolerance, bool first_will_do);

  const HalfSpaceColumns* planes_ = nullptr;
  double box_ = 0.0;
  std::vector<double> violations_;
};

}  // namespace voxkernel
