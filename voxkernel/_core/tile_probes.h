// Where segments are probed before they are walked along, and how far off.
#pragma once

#include <cstdint>

#include "avx2.h"
#include "spans.h"

namespace voxkernel {

constexpr int kProbes[4] = {0, 7, 15, 31};  // before each stage, and all
constexpr int kAllProbes = kProbes[3];
constexpr Index kNear[3] = {0, 8, 16};  // nearer along all axes a stage would find almost nothing

// Where the probes are along a segment, in parts of 64, in two orders: each next one finds most of what those before it
// miss of what is hidden on some families of bodies. Little is hidden from the middle of bodies that are nearly stars,
// and mostly just before the target.
constexpr int kOrders = 2;
constexpr Index kParts = 64;
constexpr Index kShares[kOrders][kAllProbes] = {
    {8,  16, 24, 32, 40, 48, 56, 60, 33, 53, 58, 61, 42, 19, 27, 50,
     37, 57, 59, 10, 45, 22, 35, 29, 62, 5,  26, 38, 12, 54, 41},
    {36, 59, 53, 25, 61, 57, 45, 60, 16, 56, 31, 58, 20, 40, 49, 62,
     8,  33, 42, 10, 23, 28, 48, 5,  17, 54, 12, 51, 37, 4,  41},
};
// A segment by d >= 0 voxels along an axis is, just before the share of probe p, so many voxels from its start:
// ceil(share d / 64 - 1/2).
constexpr Index probe_at(int order, int p, Index d) { return (kShares[order][p] * d + kParts / 2 - 1) / kParts; }
// Probes of all stages at places that are so far along an axis.
constexpr int n_probes(Index far) { return far < kNear[1] ? kProbes[1] : far < kNear[2] ? kProbes[2] : kProbes[3]; }

#ifdef VOXKERNEL_HAS_AVX2
// Where the first n probes are for the place of a row in line with the tile at `at`, in words: the sums of what they
// differ by along two axes. n is rounded up to a multiple of four.
template <int n>
VOXKERNEL_AVX2_INLINE void add_offsets(const std::int32_t* j, const std::int32_t* k, Index at, Index* sums) {
  const __m256i start = _mm256_set1_epi64x(at);
#pragma GCC unroll 8
  for (int p = 0; p < n; p += 4) {
    const __m128i sum = _mm_add_epi32(_mm_loadu_si128(reinterpret_cast<const __m128i*>(j + p)),
                                      _mm_loadu_si128(reinterpret_cast<const __m128i*>(k + p)));
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(sums + p), _mm256_add_epi64(start, _mm256_cvtepi32_epi64(sum)));
  }
}
#endif

}  // namespace voxkernel
