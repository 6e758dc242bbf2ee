// Equal positions share a number, in the order of their first appearance: an open table of the numbers given out.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>
#include <vector>

#include "growing_array.h"
#include "spans.h"

namespace voxkernel {

class CornerTable {
 public:
  // The number of a position among `points`, to which it is added if it is new. A position with a NaN equals none.
  Index number_of(const double* point, GrowingArray<double>& points) {
    const bool is_number = !has_nan(point);
    const Index n = points.size() / 3;
    if (is_number) {
      if (2 * (n + 1) > static_cast<Index>(slots_.size())) grow(points);
      std::size_t slot = hash(point) & (slots_.size() - 1);
      for (; slots_[slot] != 0; slot = (slot + 1) & (slots_.size() - 1)) {
        const Index other = slots_[slot] - 1;
        if (points[3 * other] == point[0] && points[3 * other + 1] == point[1] && points[3 * other + 2] == point[2]) {
          return other;
        }
      }
      slots_[slot] = n + 1;
    }
    for (int k = 0; k < 3; ++k) points.push(point[k]);
    return n;
  }

 private:
  static bool has_nan(const double* point) {
    return std::isnan(point[0]) || std::isnan(point[1]) || std::isnan(point[2]);
  }
  static std::size_t hash(const double* point) {
    std::uint64_t mixed = 0;
    for (int k = 0; k < 3; ++k) {
      const double value = point[k] + 0.0;  // both zeros are equal
      std::uint64_t bits = 0;
      std::memcpy(&bits, &value, sizeof bits);
      mixed = (mixed ^ bits) * 0x9E3779B97F4A7C15U;
      mixed ^= mixed >> 29U;
    }
    mixed *= 0xBF58476D1CE4E5B9U;
    return static_cast<std::size_t>(mixed ^ (mixed >> 32U));
  }
  void grow(GrowingArray<double>& points) {
    const std::size_t room = slots_.empty() ? 1024 : 2 * slots_.size();
    std::vector<Index>().swap(slots_);
    slots_.assign(room, 0);
    for (Index i = 0; 3 * i < points.size(); ++i) {
      const double point[3] = {points[3 * i], points[3 * i + 1], points[3 * i + 2]};
      if (has_nan(point)) continue;
      std::size_t slot = hash(point) & (room - 1);
      while (slots_[slot] != 0) slot = (slot + 1) & (room - 1);
      slots_[slot] = i + 1;
    }
  }

  std::vector<Index> slots_;
};

}  // namespace voxkernel
