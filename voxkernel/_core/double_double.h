// Numbers of twice the digits of a double: a sum high + low, |low| <= ulp(high) / 2.
//
// Sums and products are off by less than 2**-102 of |a| + |b| and of |a b| (Joldes, Muller and Popescu, "Tight and
// rigorous error bounds for basic building blocks of double-word arithmetic", 2017), short of overflow and underflow.
#pragma once

#include "expansions.h"
#include "wide_integer.h"

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

// Multiplies by a power of two, from 2**-2000 to 2**2000: exactly, short of overflow and underflow.
class Shift {
 public:
  explicit Shift(int exponent) : half_(of(exponent / 2)), rest_(of(exponent - exponent / 2)) {}

  double operator()(double value) const { return value * half_ * rest_; }
  DoubleDouble operator()(const DoubleDouble& value) const { return {(*this)(value.high), (*this)(value.low)}; }

 private:
  static double of(int exponent) {
    const auto bits = static_cast<std::uint64_t>(exponent + 1023) << 52;
    double value;
    std::memcpy(&value, &bits, sizeof value);
    return value;
  }
  double half_, rest_;
};

// Of a power of two beside which a size is about 1: at least 2**-52 and less than 2, where it is not 0.
inline int exponent_of(double size) { return bits_of(size).exponent + 52; }

}  // namespace voxkernel
