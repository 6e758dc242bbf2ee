// Doubles and planes modulo the prime 2**61 - 1: equal numbers have equal residues, at a few nanoseconds each.
//
// Doubles are integers times powers of two, and the prime is odd, so all of them have a residue, whatever their
// exponent; 2**61 is 1, so a power of two rotates the 61 bits.
#pragma once

#include <cstdint>
#include <cstring>

#if defined(_MSC_VER) && !defined(__clang__)
#include <intrin.h>
#endif

namespace voxkernel {

using Residue = std::uint64_t;  // below kPrime
constexpr Residue kPrime = (Residue{1} << 61) - 1;

inline Residue reduced(Residue sum) { return sum >= kPrime ? sum - kPrime : sum; }
inline Residue added(Residue a, Residue b) { return reduced(a + b); }
inline Residue subtracted(Residue a, Residue b) { return a >= b ? a - b : a + kPrime - b; }

// The product of 122 bits is high 2**64 + low = (8 high + the top 3 bits of low) 2**61 + the rest of low.
inline Residue multiplied(Residue a, Residue b) {
#if defined(__SIZEOF_INT128__)
  const auto product = static_cast<unsigned __int128>(a) * b;
  const auto low = static_cast<std::uint64_t>(product), high = static_cast<std::uint64_t>(product >> 64);
#else
  std::uint64_t high = __umulh(a, b);
  const std::uint64_t low = a * b;
#endif
  return reduced((low & kPrime) + ((high << 3) | (low >> 61)));
}

// a to the power of kPrime - 2: the inverse, by Fermat; a is not 0.
inline Residue inverted(Residue a) {
  Residue result = 1;
  for (Residue power = kPrime - 2; power != 0; power >>= 1) {
    if ((power & 1) != 0) result = multiplied(result, a);
    a = multiplied(a, a);
  }
  return result;
}

// Of a finite double.
inline Residue residue_of(double value) {
  std::uint64_t bits = 0;
  std::memcpy(&bits, &value, sizeof bits);
  const auto biased = static_cast<int>(bits >> 52 & 0x7ff);
  Residue mantissa = bits & ((Residue{1} << 52) - 1);
  if (biased != 0) mantissa |= Residue{1} << 52;
  // |value| = mantissa 2**(exponent - 1075); 18 * 61 is added to keep the remainder positive.
  const int shift = ((biased == 0 ? 1 : biased) + (18 * 61 - 1075)) % 61;
  const Residue size = ((mantissa << shift) & kPrime) | (mantissa >> (61 - shift));
  return (bits >> 63) != 0 && size != 0 ? kPrime - size : size;
}

}  // namespace voxkernel
