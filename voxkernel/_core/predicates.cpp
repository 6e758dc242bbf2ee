#include "predicates.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>

#include "expansions.h"

namespace voxkernel {
namespace {

#if defined(__SIZEOF_INT128__)

// Four points as integers times one power of two; its exponent has no bearing on a sign.
struct LatticePoints {
  static constexpr int kMostBits = 60;

  // False where |coordinates| need more than `kMostBits` bits in units of the last bit in use of all of them.
  bool set(const double* const* points) {
    std::uint64_t mantissas[12];
    int exponents[12], low = 4096, high = -4096;
    std::uint64_t bits = 0;
    for (int i = 0; i < 12; ++i) {
      std::memcpy(&bits, points[i / 3] + i % 3, sizeof bits);
      exponents[i] = static_cast<int>(bits >> 52 & 0x7ff);
      // Numbers in range are 0 or normal; the mantissa of 0 stays 0.
      mantissas[i] = exponents[i] == 0 ? 0 : (bits & ((std::uint64_t{1} << 52) - 1)) | std::uint64_t{1} << 52;
      is_negative_[i] = (bits >> 63) != 0;
      if (exponents[i] == 0) continue;
      low = std::min(low, exponents[i] + trailing_zeros(mantissas[i]));
      high = std::max(high, exponents[i] + 53);
    }
    if (high - low > kMostBits) return false;
    for (int i = 0; i < 12; ++i) {
      const int shift = exponents[i] - low;
      const std::uint64_t size = mantissas[i] == 0 ? 0 : shift >= 0 ? mantissas[i] << shift : mantissas[i] >> -shift;
      at[i / 3][i % 3] = is_negative_[i] ? -static_cast<std::int64_t>(size) : static_cast<std::int64_t>(size);
    }
    return true;
  }

  std::int64_t at[4][3];

 private:
  static int trailing_zeros(std::uint64_t bits) { return __builtin_ctzll(bits); }
  bool is_negative_[12];
};

// The sign of ((b - a) x (c - a)) . (d - a). Coordinates are below 2**60, so differences below 2**61 and minors below
// 2**123. With each minor m = high 2**64 + low, 0 <= low < 2**64, the three products high w and low w and their sums
// are below 3 * 2**125 < 2**127, and the sign is that of the sum of the first, or, where that and what the second
// carry over cancel, of what is left of the second.
double integer_orientation(const LatticePoints& points) {
  using Wide = __int128;
  std::int64_t e[3][3];
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) e[i][k] = points.at[i + 1][k] - points.at[0][k];
  }
  const auto minor = [&](int j, int k) { return Wide{e[0][j]} * e[1][k] - Wide{e[0][k]} * e[1][j]; };
  const Wide minors[3] = {minor(1, 2), minor(2, 0), minor(0, 1)};
  Wide high = 0, low = 0;
  for (int k = 0; k < 3; ++k) {
    high += static_cast<std::int64_t>(minors[k] >> 64) * Wide{e[2][k]};
    low += static_cast<Wide>(static_cast<std::uint64_t>(minors[k])) * e[2][k];
  }
  high += low >> 64;
  if (high != 0) return high > 0 ? 1.0 : -1.0;
  return static_cast<std::uint64_t>(low) != 0 ? 1.0 : 0.0;
}

#endif

}  // namespace

// det = a_z [bcd] - b_z [cda] + c_z [dab] - d_z [abc], where [abc] = ab + bc + ca and ab = a_x b_y - b_x a_y.
//
// Range: coordinates of magnitude 2**-300 .. 2**300 are multiples of 2**-352, so all products of two or three, and all
// sums of those, are multiples of 2**-1056: nothing underflows. Sums of 24 products of three stay below 2**905, and
// factors below 2**603: nothing overflows, in a split either.
double orient3d_exact(const double* a, const double* b, const double* c, const double* d) {
  const auto ab = difference_of_products(a[0], b[1], b[0], a[1]);
  const auto bc = difference_of_products(b[0], c[1], c[0], b[1]);
  const auto cd = difference_of_products(c[0], d[1], d[0], c[1]);
  const auto da = difference_of_products(d[0], a[1], a[0], d[1]);
  const auto ac = difference_of_products(a[0], c[1], c[0], a[1]);
  const auto bd = difference_of_products(b[0], d[1], d[0], b[1]);
  const auto first = scaled(sum(sum(bc, cd), -bd), a[2]);
  const auto second = scaled(sum(sum(cd, da), ac), -b[2]);
  const auto third = scaled(sum(sum(da, ab), bd), c[2]);
  const auto fourth = scaled(sum(sum(ab, bc), -ac), -d[2]);
  return sum(sum(first, second), sum(third, fourth)).sign();
}

// Filter. Let u = 2**-53 and S the sum of the magnitudes of the six products of three exact differences.
// Each of them goes through eight roundings: three differences, two products, the inner difference and two sums.
// So |det - exact| <= ((1 + u)^8 - 1) S. `size` is the same expression of magnitudes, so size >= (1 - u)^8 S and
// |det - exact| <= (8 u + 101 u^2) size < 9 u (1 - u)^2 size. The threshold itself is rounded twice; 1e-15 > 9 u.
//
// Underflow, in the range above: exact differences are multiples of 2**-352, rounded ones too, so products of two are 0
// or at least 2**-704 and lose nothing. The three outer products may each lose 2**-1075 (sums lose nothing), both in
// det and in size: 1e-290 > 2**-964 covers them many times over. Overflow: none, as |det| and size are below 2**910.
double orientation(const double* a, const double* b, const double* c, const double* d) {
  const double ux = b[0] - a[0], uy = b[1] - a[1], uz = b[2] - a[2];
  const double vx = c[0] - a[0], vy = c[1] - a[1], vz = c[2] - a[2];
  const double wx = d[0] - a[0], wy = d[1] - a[1], wz = d[2] - a[2];
  const double det = (uy * vz - uz * vy) * wx + (uz * vx - ux * vz) * wy + (ux * vy - uy * vx) * wz;
  const double size = (std::abs(uy * vz) + std::abs(uz * vy)) * std::abs(wx) +
                      (std::abs(uz * vx) + std::abs(ux * vz)) * std::abs(wy) +
                      (std::abs(ux * vy) + std::abs(uy * vx)) * std::abs(wz);
  if (std::abs(det) > 1e-15 * size + 1e-290) return det;
  // Products of three differences are 0 or at least 2**-1056, so `size` is 0 only where all six of them are.
  if (size == 0.0) return 0.0;
#if defined(__SIZEOF_INT128__)
  const double* const points[4] = {a, b, c, d};
  LatticePoints lattice;
  if (lattice.set(points)) return integer_orientation(lattice);
#endif
  // orient3d_exact has the opposite handedness.
  return -orient3d_exact(a, b, c, d);
}

}  // namespace voxkernel
