// A bit for each of the 256 voxels of a tile: four words, or a register of 256 bits.
#pragma once

#include <algorithm>
#include <cstdint>

#include "avx2.h"

namespace voxkernel {

using Word = std::uint64_t;

struct Four {
  Word w[4];
};
inline Four four(const Word* at) { return {{at[0], at[1], at[2], at[3]}}; }
inline Four both(const Four& a, const Four& b) {
  return {{a.w[0] & b.w[0], a.w[1] & b.w[1], a.w[2] & b.w[2], a.w[3] & b.w[3]}};
}
inline Four either(const Four& a, const Four& b) {
  return {{a.w[0] | b.w[0], a.w[1] | b.w[1], a.w[2] | b.w[2], a.w[3] | b.w[3]}};
}
inline Four without(const Four& a, const Four& b) {
  return {{a.w[0] & ~b.w[0], a.w[1] & ~b.w[1], a.w[2] & ~b.w[2], a.w[3] & ~b.w[3]}};
}
inline bool is_none(const Four& a) { return (a.w[0] | a.w[1] | a.w[2] | a.w[3]) == 0; }
inline void store(Word* at, const Four& a) { std::copy(a.w, a.w + 4, at); }

#ifdef VOXKERNEL_HAS_AVX2
VOXKERNEL_AVX2_INLINE __m256i load_words(const Word* at) {
  return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(at));
}
VOXKERNEL_AVX2_INLINE void store_words(Word* at, __m256i words) {
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(at), words);
}
VOXKERNEL_AVX2_INLINE __m256i and_all(__m256i a, __m256i b, __m256i c, __m256i d) {
  return _mm256_and_si256(_mm256_and_si256(a, b), _mm256_and_si256(c, d));
}
VOXKERNEL_AVX2_INLINE bool is_none(__m256i words) { return _mm256_testz_si256(words, words) != 0; }
#endif

}  // namespace voxkernel
