// Exact sums and products of doubles, as expansions: sums of doubles that do not overlap, smallest first.
//
// After Shewchuk, "Adaptive precision floating-point arithmetic and fast robust geometric predicates" (1997),
// whose theorems want roundings to the nearest double, ties to even, and neither overflow nor underflow.
// A sum of doubles never underflows: it is a multiple of the smallest subnormal, as both of them are. `two_product` is
// exact while the product of the last bits of its factors is at least 2**-1074 (so wherever |a b| >= 2**-968, or is 0),
// both factors are below 2**996 (because of the split) and the product is below 2**1023.
#pragma once

#include <cmath>

namespace voxkernel {

// A number as the sum of `terms[0..size)`, magnitudes growing, no zeros; N is the most it can hold.
template <int N>
struct Expansion {
  double terms[N];
  int size = 0;

  void push(double term) {
    if (term != 0.0) terms[size++] = term;
  }
  // The last term is larger than the sum of all others.
  double sign() const { return size == 0 ? 0.0 : (terms[size - 1] > 0.0 ? 1.0 : -1.0); }
};

struct HighLow {
  double high;  // the rounded result
  double low;   // its rounding error, exact
};

inline HighLow two_sum(double a, double b) {
  const double high = a + b;
  const double part = high - a;
  return {high, (a - (high - part)) + (b - part)};
}

// A double in two halves of 26 bits, so that products of halves are exact (Veltkamp).
inline HighLow split(double a) {
  constexpr double splitter = 0x1p27 + 1.0;
  const double scaled = splitter * a;
  const double high = scaled - (scaled - a);
  return {high, a - high};
}

inline HighLow two_product(double a, double b) {
  const double high = a * b;
  const HighLow x = split(a), y = split(b);
  return {high, x.low * y.low - (((high - x.high * y.high) - x.low * y.high) - x.high * y.low)};
}

// e + f (Shewchuk's fast expansion sum: terms of both by magnitude, added one after the other).
template <int N, int M>
Expansion<N + M> sum(const Expansion<N>& e, const Expansion<M>& f) {
  Expansion<N + M> result;
  double q = 0.0;
  for (int i = 0, j = 0; i < e.size || j < f.size;) {
    const bool is_e = j >= f.size || (i < e.size && std::abs(e.terms[i]) < std::abs(f.terms[j]));
    const HighLow next = two_sum(q, is_e ? e.terms[i++] : f.terms[j++]);
    q = next.high;
    result.push(next.low);
  }
  result.push(q);
  return result;
}

// e b (Shewchuk's scale expansion).
template <int N>
Expansion<2 * N> scaled(const Expansion<N>& e, double b) {
  Expansion<2 * N> result;
  double q = 0.0;
  for (int i = 0; i < e.size; ++i) {
    const HighLow product = two_product(e.terms[i], b);
    const HighLow lower = two_sum(q, product.low);
    const HighLow upper = two_sum(product.high, lower.high);
    result.push(lower.low);
    result.push(upper.low);
    q = upper.high;
  }
  result.push(q);
  return result;
}

template <int N>
Expansion<N> operator-(Expansion<N> e) {
  for (int i = 0; i < e.size; ++i) e.terms[i] = -e.terms[i];
  return e;
}

// a b - c d.
inline Expansion<4> difference_of_products(double a, double b, double c, double d) {
  const HighLow first = two_product(a, b), second = two_product(c, d);
  Expansion<2> e, f;
  e.push(first.low);
  e.push(first.high);
  f.push(-second.low);
  f.push(-second.high);
  return sum(e, f);
}

}  // namespace voxkernel
