// Exact sums and products of any length, for the few signs that a filter leaves open: `Expansion` on the heap.
#pragma once

#include <vector>

#include "expansions.h"

namespace voxkernel {

// A number as a sum of doubles that do not overlap, smallest first, without zeros.
class ExactSum {
 public:
  void add(double term) {
    if (term == 0.0) return;
    std::vector<double> grown;
    grown.reserve(terms_.size() + 1);
    double q = term;
    for (const double old : terms_) {
      const HighLow next = two_sum(q, old);
      if (next.low != 0.0) grown.push_back(next.low);
      q = next.high;
    }
    if (q != 0.0) grown.push_back(q);
    terms_ = std::move(grown);
  }
  void add_product(double a, double b) {
    const HighLow product = two_product(a, b);
    add(product.low);
    add(product.high);
  }
  void add(const ExactSum& other, double sign) {
    for (const double term : other.terms_) add(sign * term);
  }
  ExactSum times(const ExactSum& other) const {
    ExactSum result;
    for (const double a : terms_) {
      for (const double b : other.terms_) result.add_product(a, b);
    }
    return result;
  }
  // The last term is larger than the sum of all others.
  int sign() const { return terms_.empty() ? 0 : (terms_.back() > 0.0 ? 1 : -1); }

 private:
  std::vector<double> terms_;
};

}  // namespace voxkernel
