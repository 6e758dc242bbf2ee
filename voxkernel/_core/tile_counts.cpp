#include "tile_counts.h"

#include <algorithm>

namespace voxkernel {
namespace {

constexpr Index kBits = 64;
constexpr Index kAtOnce = 8;

// A byte for each of eight bits.
Word bytes_of(Word bits) {
  return (((bits * 0x0101010101010101u & 0x8040201008040201u) + 0x7f7f7f7f7f7f7f7fu) >> 7) & 0x0101010101010101u;
}

// Adds sixteen bits to each of 256 counts.
VOXKERNEL_ALWAYS_INLINE void add_up(Word (*sums)[4], const Word (*bits)[4]) {
  Word carries[4];
  for (int w = 0; w < 4; ++w) {
    Word ones = sums[0][w], twos = sums[1][w], fours = sums[2][w], eights = sums[3][w];
    Word eight[2];
    for (int e = 0; e < 2; ++e) {
      Word four[2];
      for (int f = 0; f < 2; ++f) {
        const int b = 8 * e + 4 * f;
        const Word a = add_two(ones, bits[b][w], bits[b + 1][w]), c = add_two(ones, bits[b + 2][w], bits[b + 3][w]);
        four[f] = add_two(twos, a, c);
      }
      eight[e] = add_two(fours, four[0], four[1]);
    }
    carries[w] = add_two(eights, eight[0], eight[1]);
    sums[0][w] = ones;
    sums[1][w] = twos;
    sums[2][w] = fours;
    sums[3][w] = eights;
  }
  for (int l = 4; (carries[0] | carries[1] | carries[2] | carries[3]) != 0; ++l) {
    for (int w = 0; w < 4; ++w) {
      const Word sum = sums[l][w] ^ carries[w];
      carries[w] &= sums[l][w];
      sums[l][w] = sum;
    }
  }
}

#ifdef VOXKERNEL_HAS_AVX2
VOXKERNEL_AVX2 void add_up_avx2(Word (*sums)[4], const Word (*bits)[4]) { add_up(sums, bits); }
#endif

}  // namespace

void TileCounts::clear() {
  n_waiting = n_fours = 0;
  for (int l = 0; l < kLevels; ++l) std::fill_n(sums[l], 4, Word{0});
}

void TileCounts::settle() {
  settle(sums, waiting, n_waiting);
  settle(sums + 2, fours, n_fours);
}

void TileCounts::settle(Word (*to)[4], Word (*from)[4], Index& n) {
  if (n == 0) return;
  for (; n < kWaiting; ++n) std::fill_n(from[n], 4, Word{0});
  n = 0;
#ifdef VOXKERNEL_HAS_AVX2
  if (has_avx2) {
    add_up_avx2(to, from);
    return;
  }
#endif
  add_up(to, from);
}

void TileCounts::start(Span<const Index> counts, Index enough, Word* of) {
  Index all = 0;
  for (Index n = 0; n < kVoxels; n += kAtOnce) {
    Index own[kAtOnce];
    Word kept = 0;
    for (Index v = 0; v < kAtOnce; ++v) {
      const bool is_kept = counts[n + v] <= enough;
      own[v] = is_kept ? counts[n + v] : 0;
      kept |= (is_kept ? Word{1} : 0) << v;
      all |= own[v];
    }
    of[n / kBits] &= kept << (n % kBits) | ~(Word{0xff} << (n % kBits));
    if (all == 0) continue;
    for (int l = 0; l < n_levels; ++l) {
      Word bits = 0;
      for (Index v = 0; v < kAtOnce; ++v) bits |= static_cast<Word>(own[v] >> l & 1) << v;
      sums[l][n / kBits] |= bits << (n % kBits);
    }
  }
}

void TileCounts::keep_up_to(Index enough, Word* of) const {
  for (int w = 0; w < 4; ++w) {
    Word above = 0, equal = ~Word{0};
    for (int l = n_levels - 1; l >= 0; --l) {
      const Word is_set = sums[l][w];
      if ((enough >> l & 1) == 0) above |= equal & is_set;
      equal &= (enough >> l & 1) == 0 ? ~is_set : is_set;
    }
    of[w] &= ~above;
  }
}

void TileCounts::write(Span<Index> counts, const Word* of) const {
  for (Index n = 0; n < kVoxels; n += kAtOnce) {
    const Word kept = of[n / kBits] >> (n % kBits) & 0xff;
    if (kept == 0) continue;
    Word parts[3] = {0, 0, 0};  // eight levels each
    for (int l = 0; l < n_levels; ++l) {
      parts[l / kAtOnce] |= bytes_of(sums[l][n / kBits] >> (n % kBits) & 0xff) << (l % kAtOnce);
    }
    for (Index v = 0; v < kAtOnce; ++v) {
      if ((kept >> v & 1) == 0) continue;
      const int by = static_cast<int>(v * kAtOnce);
      counts[n + v] =
          static_cast<Index>((parts[0] >> by & 0xff) | (parts[1] >> by & 0xff) << 8 | (parts[2] >> by & 0xff) << 16);
    }
  }
}

}  // namespace voxkernel
