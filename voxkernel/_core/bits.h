// Bits of 64-bit words: how many, the lowest, the highest.
#pragma once

#include <cstdint>

#include "spans.h"

#if defined(_MSC_VER) && !defined(__clang__)
#include <intrin.h>
#endif

namespace voxkernel {

// In plain arithmetic: the instruction is not on every processor that the wheel runs on.
inline Index count_bits(std::uint64_t x) {
  x -= x >> 1 & 0x5555555555555555u;
  x = (x & 0x3333333333333333u) + (x >> 2 & 0x3333333333333333u);
  x = (x + (x >> 4)) & 0x0f0f0f0f0f0f0f0fu;
  return static_cast<Index>(x * 0x0101010101010101u >> 56);
}

// Of a word that is not 0.
inline Index lowest_bit(std::uint64_t x) {
#if defined(_MSC_VER) && !defined(__clang__)
  unsigned long at;
  _BitScanForward64(&at, x);
  return static_cast<Index>(at);
#else
  return __builtin_ctzll(x);
#endif
}
inline Index highest_bit(std::uint64_t x) {
#if defined(_MSC_VER) && !defined(__clang__)
  unsigned long at;
  _BitScanReverse64(&at, x);
  return static_cast<Index>(at);
#else
  return 63 - __builtin_clzll(x);
#endif
}

}  // namespace voxkernel
