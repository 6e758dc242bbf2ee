// Wider vectors, chosen at run time: what the passes over lists of planes share. Every such pass has a plain twin
// that gives the same bits.
#pragma once

#include <cstdlib>

#if defined(__x86_64__) && defined(__GNUC__)
#define VOXKERNEL_HAS_AVX2 1
#define VOXKERNEL_AVX2 __attribute__((target("avx2")))
#define VOXKERNEL_AVX2_INLINE __attribute__((target("avx2"), always_inline)) inline
#include <immintrin.h>

#include "spans.h"
#endif

// For what is compiled twice, plain and for wider vectors: it must become a part of both functions.
#if defined(__GNUC__)
#define VOXKERNEL_ALWAYS_INLINE __attribute__((always_inline)) inline
#else
#define VOXKERNEL_ALWAYS_INLINE inline
#endif

namespace voxkernel {

// Whether this processor has them; VOXKERNEL_AVX2=0 in the environment says no, for tests of the plain passes.
inline bool wide_vectors_found() {
#ifdef VOXKERNEL_HAS_AVX2
  const char* chosen = std::getenv("VOXKERNEL_AVX2");
  __builtin_cpu_init();
  return __builtin_cpu_supports("avx2") && !(chosen != nullptr && chosen[0] == '0');
#else
  return false;
#endif
}
inline const bool has_avx2 = wide_vectors_found();

#ifdef VOXKERNEL_HAS_AVX2

// What moves the lanes of a mask of four to the front, as a permutation of eight 32-bit halves.
alignas(32) inline constexpr std::uint32_t kLanesToFront[16][8] = {
    {0, 1, 2, 3, 4, 5, 6, 7}, {0, 1, 2, 3, 4, 5, 6, 7}, {2, 3, 0, 1, 4, 5, 6, 7}, {0, 1, 2, 3, 4, 5, 6, 7},
    {4, 5, 0, 1, 2, 3, 6, 7}, {0, 1, 4, 5, 2, 3, 6, 7}, {2, 3, 4, 5, 0, 1, 6, 7}, {0, 1, 2, 3, 4, 5, 6, 7},
    {6, 7, 0, 1, 2, 3, 4, 5}, {0, 1, 6, 7, 2, 3, 4, 5}, {2, 3, 6, 7, 0, 1, 4, 5}, {0, 1, 2, 3, 6, 7, 4, 5},
    {4, 5, 6, 7, 0, 1, 2, 3}, {0, 1, 4, 5, 6, 7, 2, 3}, {2, 3, 4, 5, 6, 7, 0, 1}, {0, 1, 2, 3, 4, 5, 6, 7}};
alignas(32) inline constexpr std::int64_t kFirstLanes[8] = {-1, -1, -1, -1, 0, 0, 0, 0};

// All bits in the first `n` lanes of four, none in the rest.
VOXKERNEL_AVX2_INLINE __m256i first_lanes(Index n) {
  return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(kFirstLanes + 4 - (n < 4 ? n : 4)));
}
VOXKERNEL_AVX2_INLINE __m256i load(const Index* values) {
  return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(values));
}
VOXKERNEL_AVX2_INLINE __m256i load_bits(const double* values) { return _mm256_castpd_si256(_mm256_loadu_pd(values)); }
VOXKERNEL_AVX2_INLINE __m256i lanes_to_front(int mask) {
  return _mm256_load_si256(reinterpret_cast<const __m256i*>(kLanesToFront[mask]));
}
// Writes four numbers, those that `order` moves to the front first; what follows them is scratch.
template <typename T>
VOXKERNEL_AVX2_INLINE void store_kept(T* to, __m256i values, __m256i order) {
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(to), _mm256_permutevar8x32_epi32(values, order));
}
VOXKERNEL_AVX2_INLINE __m256i kept_if(__m256d condition, __m256i values) {
  return _mm256_and_si256(_mm256_castpd_si256(condition), values);
}
VOXKERNEL_AVX2_INLINE Index sum(__m256i values) {
  alignas(32) Index lanes[4];
  _mm256_store_si256(reinterpret_cast<__m256i*>(lanes), values);
  return lanes[0] + lanes[1] + lanes[2] + lanes[3];
}
// The coordinates of four rows (x, y, z) that follow each other, a column each.
struct Columns {
  __m256d x, y, z;
};
VOXKERNEL_AVX2_INLINE Columns columns_of_four(const double* rows) {
  const __m256d a = _mm256_loadu_pd(rows), b = _mm256_loadu_pd(rows + 4), c = _mm256_loadu_pd(rows + 8);
  const __m256d xy = _mm256_blend_pd(a, b, 0b1100);       // x0 y0 x2 y2
  const __m256d zx = _mm256_permute2f128_pd(a, c, 0x21);  // z0 x1 z2 x3
  const __m256d yz = _mm256_blend_pd(b, c, 0b1100);       // y1 z1 y3 z3
  return {_mm256_shuffle_pd(xy, zx, 0b1010), _mm256_shuffle_pd(xy, yz, 0b0101), _mm256_shuffle_pd(zx, yz, 0b1010)};
}
VOXKERNEL_AVX2_INLINE void store_rows_of_four(double* rows, const Columns& columns) {
  const __m256d xy = _mm256_unpacklo_pd(columns.x, columns.y);         // x0 y0 x2 y2
  const __m256d zx = _mm256_shuffle_pd(columns.z, columns.x, 0b1010);  // z0 x1 z2 x3
  const __m256d yz = _mm256_unpackhi_pd(columns.y, columns.z);         // y1 z1 y3 z3
  _mm256_storeu_pd(rows, _mm256_permute2f128_pd(xy, zx, 0x20));
  _mm256_storeu_pd(rows + 4, _mm256_blend_pd(yz, xy, 0b1100));
  _mm256_storeu_pd(rows + 8, _mm256_permute2f128_pd(zx, yz, 0x31));
}
VOXKERNEL_AVX2_INLINE __m256d negative(__m256d values) { return _mm256_xor_pd(values, _mm256_set1_pd(-0.0)); }

#endif

}  // namespace voxkernel
