// Numbers of twice the digits of a double: a sum high + low, |low| <= ulp(high) / 2.
//
// Sums and products are off by less than 2**-102 of |a| + |b| and of |a b| (Joldes, Muller and Popescu, "Tight and
// rigorous error bounds for basic building blocks of double-word arithmetic", 2017), short of overflow and underflow.
#pragma once

#include "expansions.h"

namespace voxkernel {

struct DoubleDouble {
  double high = 0.0, low = 0.0;
};

inline DoubleDouble quick_sum(double a, double b) {
  const double high = a + b;
  return {high, b - (high - a)};
}

inline DoubleDouble operator+(const DoubleDouble& a, const DoubleDouble& b) {
  const HighLow s = two_sum(a.high, b.high);
  return quick_sum(s.high, s.low + (a.low + b.low));
}

inline DoubleDouble operator-(const DoubleDouble& a) { return {-a.high, -a.low}; }
inline DoubleDouble operator-(const DoubleDouble& a, const DoubleDouble& b) { return a + -b; }

inline DoubleDouble operator*(const DoubleDouble& a, const DoubleDouble& b) {
  const HighLow p = two_product(a.high, b.high);
  return quick_sum(p.high, p.low + (a.high * b.low + a.low * b.high));
}

}  // namespace voxkernel
