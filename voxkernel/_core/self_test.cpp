#include "self_test.h"

namespace voxkernel {

const char* arithmetic_fault() {
  // Volatile, so that the answers are made when the program runs and not when it is compiled.
  volatile double one = 1.0, tiny = 0x1p-60, third = 1.0 / 3.0, large = 0x1p53;
  // The rounding error of 1 + 2^-60, as a two-sum finds it: zero where sums are reordered.
  const double sum = one + tiny;
  const double part = sum - one;
  const double lost = (one - (sum - part)) + (tiny - part);
  if (lost != 0x1p-60) return "it reorders sums";
  // a * b - a * b is zero unless one product is kept unrounded by a fused multiply-add.
  const double product = third * third;
  if (third * third - product != 0.0) return "it contracts products and sums";
  // 2^53 + 1 rounds to 2^53 in double, and not in wider registers.
  if ((large + one) - large != 0.0) return "it computes in more than double precision";
  // Loops start minima at infinity, and a comparison with NaN must be false.
  volatile double zero = 0.0, nothing = 0.0;
  volatile double none = zero / nothing;
  if (none >= zero || none < zero || !(one / zero > 0x1.fffffffffffffp1023)) return "it knows neither infinity nor NaN";
  volatile double smallest = 0x1p-1074;
  if (smallest * one == 0.0 || smallest + smallest != 0x1p-1073) return "it flushes subnormal numbers to zero";
  return nullptr;
}

}  // namespace voxkernel
