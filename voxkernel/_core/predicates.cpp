#include "predicates.h"

#include <cmath>

#include "expansions.h"

namespace voxkernel {

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
  // orient3d_exact has the opposite handedness.
  return -orient3d_exact(a, b, c, d);
}

}  // namespace voxkernel
