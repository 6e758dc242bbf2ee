// Coordinates times a power of two, so that products of their differences do not overflow.
#pragma once

#include <algorithm>
#include <cmath>

namespace voxkernel {

// Times 2^-exponent, for exponents of doubles.
class Scaling {
 public:
  explicit Scaling(int exponent) {
    constexpr int kMost = 1000;  // 2^1073 is no double
    const int beyond = std::max(0, -exponent - kMost);
    first_ = std::ldexp(1.0, -exponent - beyond);
    second_ = std::ldexp(1.0, beyond);
  }
  double operator()(double value) const { return value * first_ * second_; }

 private:
  double first_, second_;  // the second is 1, or one factor alone would be too large
};

}  // namespace voxkernel
