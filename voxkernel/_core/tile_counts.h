// Counts of the 256 voxels of a tile, a plane of bits for each binary digit, so that one addition counts for all.
#pragma once

#include "spans.h"
#include "tile_words.h"

namespace voxkernel {

// What is added waits until there are sixteen, so do the fours of it that are already summed up.
struct TileCounts {
  static constexpr Index kVoxels = 256;
  static constexpr Index kWaiting = 16;
  static constexpr int kLevels = 24;  // binary digits

  Word sums[kLevels][4], waiting[kWaiting][4], fours[kWaiting][4];
  Index n_waiting = 0, n_fours = 0;
  int n_levels = kLevels;  // what the largest count takes

  void clear();
  // Starts from the counts of some voxels, those of at most `enough`; leaves out the others.
  void start(Span<const Index> counts, Index enough, Word* of);
  // Counts what stands in the next place of `waiting`, or of `fours`.
  void count_waiting() {
    if (++n_waiting == kWaiting) settle(sums, waiting, n_waiting);
  }
  void count_fours() {
    if (++n_fours == kWaiting) settle(sums + 2, fours, n_fours);
  }
  // Adds what waits, so that the sums are the counts.
  void settle();
  // Leaves out the voxels whose count is larger.
  void keep_up_to(Index enough, Word* of) const;
  void write(Span<Index> counts, const Word* of) const;

 private:
  static void settle(Word (*to)[4], Word (*from)[4], Index& n);
};

// Adds two bits to a sum; what is carried to the next level comes back.
VOXKERNEL_ALWAYS_INLINE Word add_two(Word& sum, Word a, Word b) {
  const Word one = sum ^ a, carry = (sum & a) | (one & b);
  sum = one ^ b;
  return carry;
}

#ifdef VOXKERNEL_HAS_AVX2
VOXKERNEL_AVX2_INLINE __m256i add_two(__m256i& sum, __m256i a, __m256i b) {
  const __m256i one = _mm256_xor_si256(sum, a);
  const __m256i carry = _mm256_or_si256(_mm256_and_si256(sum, a), _mm256_and_si256(one, b));
  sum = _mm256_xor_si256(one, b);
  return carry;
}
#endif

}  // namespace voxkernel
