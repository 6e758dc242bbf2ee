// Along a column (x, y) a plane is violated on one side of a limit that is linear in x and y: two additions to a
// difference array replace the test of eight voxels.
#include "brick_sums.h"

#include <cmath>

#include "avx2.h"
#include "brick_columns.h"

namespace voxkernel {
namespace {

// A plane is violated above its limits where its value grows with z, below them elsewhere.
ColumnLimits limits_of(const PlaneView& p, Index t, double half) {
  return {p, t, half, half * (p.reach[t] + kLimitRounding)};
}

// Adds changes at the limits of the planes; returns what is violated at the start of every column.
Index add_columns_plain(const PlaneView& p, Index first, Index last, double half, BrickSums& sums) {
  const auto limit = [](double z) { return static_cast<int>(std::ceil(std::min(8.0, std::max(0.0, z)))); };
  Index base = 0;
  for (Index t = first; t < last; ++t) {
    const ColumnLimits plane = limits_of(p, t, half);
    Index w = p.weight[t];
    if (!plane.is_up) {  // everywhere, less what is above
      base += w;
      w = -w;
    }
    for (int c = 0; c < 64; ++c) {
      const double shift = plane.step_x * (c >> 3) + plane.step_y * (c & 7);
      sums.low[c + 64 * limit(plane.high + shift)] += w;
      sums.high[c + 64 * limit(plane.low + shift)] += w;
    }
  }
  return base;
}

void add_up_plain(BrickSums& sums, Index base) {
  for (int c = 0; c < 64; ++c) {
    sums.low[c] += base;
    sums.high[c] += base;
  }
  for (int c = 64; c < 512; ++c) {
    sums.low[c] += sums.low[c - 64];
    sums.high[c] += sums.high[c - 64];
  }
}

// Bits 8 x + y of one layer z.
Word above_plain(const Index* layer, Index bound) {
  Word bits = 0;
  for (int c = 0; c < 64; ++c) bits |= static_cast<Word>(layer[c] > bound) << c;
  return bits;
}

#ifdef VOXKERNEL_HAS_AVX2

VOXKERNEL_AVX2_INLINE __m256i limits_of_four(__m256d limit) {
  const __m256d clamped = _mm256_min_pd(_mm256_max_pd(limit, _mm256_setzero_pd()), _mm256_set1_pd(8.0));
  return _mm256_castsi128_si256(_mm256_cvttpd_epi32(_mm256_ceil_pd(clamped)));
}

// Where the limits of the eight columns of one x are: c + 64 z.
VOXKERNEL_AVX2_INLINE __m256i entries(__m256d limit, __m256d shift0, __m256d shift1, __m256i column) {
  const __m256i z = _mm256_inserti128_si256(limits_of_four(_mm256_add_pd(limit, shift0)),
                                            _mm256_castsi256_si128(limits_of_four(_mm256_add_pd(limit, shift1))), 1);
  return _mm256_add_epi32(_mm256_slli_epi32(z, 6), column);
}

VOXKERNEL_AVX2 Index add_columns_avx2(const PlaneView& planes, Index first, Index last, double half, BrickSums& sums) {
  const PlaneView p = planes;
  Index* const low = sums.low;
  Index* const high = sums.high;
  alignas(32) std::uint32_t at_low[64], at_high[64];
  Index base = 0;
  for (Index t = first; t < last; ++t) {
    const ColumnLimits plane = limits_of(p, t, half);
    const __m256d certain = _mm256_set1_pd(plane.high), possible = _mm256_set1_pd(plane.low);
    const __m256d step_x = _mm256_set1_pd(plane.step_x), step_y = _mm256_set1_pd(plane.step_y);
    const __m256d y0 = _mm256_mul_pd(step_y, _mm256_setr_pd(0, 1, 2, 3)),
                  y1 = _mm256_mul_pd(step_y, _mm256_setr_pd(4, 5, 6, 7));
    __m256i column = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
#pragma GCC unroll 8
    for (int x = 0; x < 8; ++x) {
      const __m256d along_x = _mm256_mul_pd(step_x, _mm256_set1_pd(x));
      const __m256d shift0 = _mm256_add_pd(along_x, y0), shift1 = _mm256_add_pd(along_x, y1);
      _mm256_store_si256(reinterpret_cast<__m256i*>(at_low + 8 * x), entries(certain, shift0, shift1, column));
      _mm256_store_si256(reinterpret_cast<__m256i*>(at_high + 8 * x), entries(possible, shift0, shift1, column));
      column = _mm256_add_epi32(column, _mm256_set1_epi32(8));
    }
    Index w = p.weight[t];
    if (!plane.is_up) {
      base += w;
      w = -w;
    }
#pragma GCC unroll 8
    for (int c = 0; c < 64; ++c) {
      low[at_low[c]] += w;
      high[at_high[c]] += w;
    }
  }
  return base;
}

VOXKERNEL_AVX2 void add_up_avx2(BrickSums& sums, Index base) {
  const __m256i all = _mm256_set1_epi64x(base);
  for (Index* values : {sums.low, sums.high}) {
    for (int c = 0; c < 64; c += 4) {
      __m256i total = all;
#pragma GCC unroll 8
      for (int z = 0; z < 512; z += 64) {
        total = _mm256_add_epi64(total, load(values + z + c));
        _mm256_store_si256(reinterpret_cast<__m256i*>(values + z + c), total);
      }
    }
  }
}

VOXKERNEL_AVX2 Word above_avx2(const Index* layer, Index bound) {
  const __m256i most = _mm256_set1_epi64x(bound);
  Word bits = 0;
#pragma GCC unroll 16
  for (int c = 0; c < 64; c += 4) {
    const __m256i above = _mm256_cmpgt_epi64(load(layer + c), most);
    bits |= static_cast<Word>(_mm256_movemask_pd(_mm256_castsi256_pd(above))) << c;
  }
  return bits;
}

#endif

Index add_columns(const PlaneView& p, Index first, Index last, double half, BrickSums& sums) {
#ifdef VOXKERNEL_HAS_AVX2
  if (has_avx2) return add_columns_avx2(p, first, last, half, sums);
#endif
  return add_columns_plain(p, first, last, half, sums);
}

// Turns changes along the columns into what each voxel violates.
void add_up(BrickSums& sums, Index base) {
#ifdef VOXKERNEL_HAS_AVX2
  if (has_avx2) return add_up_avx2(sums, base);
#endif
  add_up_plain(sums, base);
}

Word above(const Index* layer, Index bound) {
#ifdef VOXKERNEL_HAS_AVX2
  if (has_avx2) return above_avx2(layer, bound);
#endif
  return above_plain(layer, bound);
}

// Swaps rows and columns of 8 x 8 bits; H. S. Warren, "Hacker's Delight", 2013, section 7-3.
Word transposed(Word bits) {
  Word change = (bits ^ (bits >> 7)) & 0x00AA00AA00AA00AAu;
  bits ^= change ^ (change << 7);
  change = (bits ^ (bits >> 14)) & 0x0000CCCC0000CCCCu;
  bits ^= change ^ (change << 14);
  change = (bits ^ (bits >> 28)) & 0x00000000F0F0F0F0u;
  return bits ^ change ^ (change << 28);
}

// Masks (word x, bit 8 y + z) of the voxels above a bound.
void above(const Index* values, Index bound, Word (&masks)[8]) {
  Word layers[8];
  for (int z = 0; z < 8; ++z) layers[z] = above(values + 64 * z, bound);
  for (int x = 0; x < 8; ++x) {
    Word rows = 0;  // row z, column y
    for (int z = 0; z < 8; ++z) rows |= (layers[z] >> (8 * x) & 0xFF) << (8 * z);
    masks[x] = transposed(rows);
  }
}

}  // namespace

void fill_sums(const PlaneView& planes, Index first, Index last, double half, Index certain, BrickSums& sums) {
  std::fill_n(sums.low, 512, 0);
  std::fill_n(sums.high, 512, 0);
  add_up(sums, certain + add_columns(planes, first, last, half, sums));
}

Content fill_masks(const BrickSums& sums, Index most_inside, Index least_outside, Word (&inside)[8],
                   Word (&boundary)[8]) {
  Word possible = 0, full = kAllBits;
  above(sums.high, most_inside, inside);
  above(sums.low, least_outside, boundary);
  for (int x = 0; x < 8; ++x) {
    inside[x] = ~inside[x];
    possible |= ~boundary[x];
    boundary[x] = ~(inside[x] | boundary[x]);
    full &= inside[x];
  }
  if (possible == 0) return Content::nothing;
  return full == kAllBits ? Content::everything : Content::some;
}

}  // namespace voxkernel
