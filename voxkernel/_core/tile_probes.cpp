#include "tile_probes.h"

#include <algorithm>
#include <cstdlib>

#include "avx2.h"
#include "label_tiles.h"

namespace voxkernel {
namespace {

constexpr int kPeriods[kOrders][2] = {{8, 64}, {64, 64}};  // the shares of a stage are multiples of the inverse
constexpr int kWritten = 1;  // last stage whose probes are written out place by place; more of them is much code
constexpr int kPlacesAtOnce = 4;
constexpr Index kOften = 600;  // places after which it is asked which voxels of a tile are out of the race

// Rows of a part: every so many from the tile and some more, in planes by their distance from the tile modulo 4; none
// where it is 0.
struct Part {
  struct Rows {
    Index every, from;
  } planes[4];
};
constexpr Part kRows[4] = {
    {{{0, 0}, {0, 0}, {4, 2}, {0, 0}}},  // a sixteenth of the rows
    {{{2, 0}, {0, 0}, {4, 0}, {0, 0}}},  // three sixteenths
    {{{2, 1}, {1, 0}, {2, 1}, {1, 0}}},  // the rest
    {{{1, 0}, {1, 0}, {1, 0}, {1, 0}}},  // all
};
constexpr Part::Rows kFlatRows[4] = {{4, 2}, {4, 0}, {2, 1}, {1, 0}};  // of a single plane

}  // namespace

// What a probe of a segment finds outside is hidden.
void LabelTiles::bound(int pass, const Index* low, Index enough, Span<Index> hidden, Index& n_steps, Stop& stop) {
  start_at(low, enough, hidden);
  Word of[4];
  std::copy_n(own_, 4, of);
  if (order_ == 0) {
    probe_all<0>(pass, enough, n_steps, stop);
  } else {
    probe_all<1>(pass, enough, n_steps, stop);
  }
  counts_.write(hidden, of);
}

template <int order>
void LabelTiles::probe_all(int pass, Index enough, Index& n_steps, Stop& stop) {
  constexpr int kAll = 3;
  if (pass < kAll) probe_rows<order, 0>(pass, enough, n_steps, stop);
  if (pass == kAll) probe_rows<order, 1>(kAll, enough, n_steps, stop);
  if (pass > kAll) probe_rows<order, 2>(kAll, enough, n_steps, stop);
}

// Far planes first.
template <int order, int stage>
void LabelTiles::probe_rows(int part, Index enough, Index& n_steps, Stop& stop) {
  Index first = 0, last = shape_[1] - 1, n_waiting = 0;
  for (Index p = 0; p < shape_[1]; ++p) {
    const Index j = last - low_[1] > low_[1] - first ? last-- : first++;
    const Part::Rows rows = is_flat_ ? kFlatRows[part] : kRows[part].planes[(j - low_[1]) & 3];
    if (rows.every == 0) continue;
    const Index low_k = planes_[2 * j], high_k = planes_[2 * j + 1], from = low_[2] + rows.from;
    for (Index k = from - (from - low_k) / rows.every * rows.every; k <= high_k; k += rows.every) {
      if (k < low_k || first_[j * shape_[2] + k] > last_[j * shape_[2] + k]) continue;
#ifdef VOXKERNEL_HAS_AVX2
      if (has_avx2) {
        if constexpr (stage > kWritten) {
          probe_by_tables<stage>(j, k);
        } else {
          probe_avx2<order, stage>(j, k);
        }
        continue;
      }
#endif
      probe<stage>(j, k);
    }
    stop.poll(n_steps_);
    n_steps += n_steps_;
    n_waiting += n_steps_;
    n_steps_ = 0;
    if (n_waiting < kOften) continue;
    n_waiting = 0;
    if (drop(enough)) break;
  }
  counts_.settle();
}

// Only what the probes of the stages before did not find is counted.
template <int stage>
void LabelTiles::probe(Index j, Index k) {
  const Index first = first_[j * shape_[2] + k], last = last_[j * shape_[2] + k];
  const Word* to = words_.data() + (j * shape_[2] + k) * shape_[0] + first;
  const std::int32_t* probes_i = probes_[0].data() + (first - low_[0] + shape_[0] - 1) * kAllProbes;
  const std::int32_t* const probes_j = probes_[1].data() + (j - low_[1] + shape_[1] - 1) * kAllProbes;
  const std::int32_t* const probes_k = probes_[2].data() + (k - low_[2] + shape_[2] - 1) * kAllProbes;
  const Word* probed[kAllProbes];
  for (int p = 0; p < kProbes[stage + 1]; ++p) probed[p] = words_.data() + at_ + probes_j[p] + probes_k[p];
  const bool is_far = std::max(std::abs(j - low_[1]), std::abs(k - low_[2])) >= kNear[stage];
  for (Index i = first; i <= last; ++i, ++to, probes_i += kAllProbes) {
    if (!is_far && std::abs(i - low_[0]) < kNear[stage]) continue;
    ++n_steps_;
    Four wanted = both(four(own_), four(to));
    if (is_none(wanted)) continue;
    for (int p = 0; p < kProbes[stage]; ++p) wanted = both(wanted, four(probed[p] + probes_i[p]));
    if (is_none(wanted)) continue;
    Four seen = wanted;
    for (int p = kProbes[stage]; p < kProbes[stage + 1]; ++p) seen = both(seen, four(probed[p] + probes_i[p]));
    const Four hidden = without(wanted, seen);
    store(counts_.waiting[counts_.n_waiting], hidden);
    if (!is_none(hidden)) counts_.count_waiting();
  }
}

#ifdef VOXKERNEL_HAS_AVX2
VOXKERNEL_AVX2_INLINE bool is_none_of_four(const __m256i* words) {
  return is_none(_mm256_or_si256(_mm256_or_si256(words[0], words[1]), _mm256_or_si256(words[2], words[3])));
}

// What probes see of four places in a row. The first is at a multiple of the period from the tile and `start` more;
// `probed`: where the probes are for that multiple, in words. Places that are next to each other share many probes.
template <int order, int first, int last, bool is_up, int start>
VOXKERNEL_AVX2_INLINE void see_four(const Word* words, const Index* probed, __m256i* seen) {
#pragma GCC unroll 16
  for (int p = first; p < last; ++p) {
#pragma GCC unroll 4
    for (int t = 0; t < kPlacesAtOnce; ++t) {
      const Index n = probe_at(order, p, start + t);
      seen[t] = _mm256_and_si256(seen[t], load_words(words + probed[p] + (is_up ? n : -n)));
    }
  }
}

template <int order, int stage, bool is_up, int start>
VOXKERNEL_AVX2_INLINE void LabelTiles::probe_four(const Word* to, const Index* probed, __m256i own, bool has_first,
                                                  Sums& sums) {
  const Word* const words = words_.data();
  __m256i wanted[kPlacesAtOnce], seen[kPlacesAtOnce];
  for (int t = 0; t < kPlacesAtOnce; ++t) {
    wanted[t] = _mm256_and_si256(own, load_words(is_up ? to + start + t : to - start - t));
    if (t == 0 && !has_first) wanted[t] = _mm256_setzero_si256();
  }
  if (is_none_of_four(wanted)) return;
  if (stage > 0) {
    see_four<order, 0, kProbes[stage], is_up, start>(words, probed, wanted);
    if (is_none_of_four(wanted)) return;
  }
  for (int t = 0; t < kPlacesAtOnce; ++t) seen[t] = wanted[t];
  see_four<order, kProbes[stage], kProbes[stage + 1], is_up, start>(words, probed, seen);
  const __m256i a =
      add_two(sums.ones, _mm256_andnot_si256(seen[0], wanted[0]), _mm256_andnot_si256(seen[1], wanted[1]));
  const __m256i b =
      add_two(sums.ones, _mm256_andnot_si256(seen[2], wanted[2]), _mm256_andnot_si256(seen[3], wanted[3]));
  const __m256i carry = add_two(sums.twos, a, b);
  store_words(counts_.fours[counts_.n_fours], carry);
  if (!is_none(carry)) counts_.count_fours();
}

// The places of a period.
template <int order, int stage, bool is_up, int start>
VOXKERNEL_AVX2_INLINE void LabelTiles::probe_period(const Word* to, const Index* probed, __m256i own, Index nearest,
                                                    Index farthest, Sums& sums) {
  if (start > farthest) return;
  if (start + kPlacesAtOnce > nearest) {
    probe_four<order, stage, is_up, start>(to, probed, own, is_up || start > 0 || nearest <= 0, sums);
  }
  if constexpr (start + kPlacesAtOnce < kPeriods[order][stage]) {
    probe_period<order, stage, is_up, start + kPlacesAtOnce>(to, probed, own, nearest, farthest, sums);
  }
}

// One way from the tile; `to` and `probed` are for the place in line with it. Rows have layers of background at both
// ends, so that places beyond them count nothing.
template <int order, int stage, bool is_up>
VOXKERNEL_AVX2_INLINE void LabelTiles::probe_way(const Word* to, Index* probed, Index nearest, Index farthest,
                                                 __m256i own, Sums& sums) {
  constexpr Index way = is_up ? 1 : -1, period = kPeriods[order][stage];
  if (nearest > farthest) return;
  n_steps_ += farthest + 1 - nearest;
  Index d = 0;
  const auto move_by = [&](Index by) {
    for (int p = 0; p < kProbes[stage + 1]; ++p) probed[p] += way * kShares[order][p] * by / kParts;
    to += way * by;
    d += by;
  };
  if (nearest >= period) move_by(nearest / period * period);
  while (true) {
    probe_period<order, stage, is_up, 0>(to, probed, own, nearest - d, farthest - d, sums);
    if (d + period > farthest) {
      if (d > 0) move_by(-d);
      return;
    }
    move_by(period);
  }
}

// As `probe`.
template <int stage>
VOXKERNEL_AVX2 void LabelTiles::probe_by_tables(Index j, Index k) {
  const Index first = first_[j * shape_[2] + k], last = last_[j * shape_[2] + k];
  const bool is_far = std::max(std::abs(j - low_[1]), std::abs(k - low_[2])) >= kNear[stage];
  const __m256i own = load_words(own_);
  Index probed[kAllProbes + 1];
  add_offsets<kProbes[stage + 1]>(probes_[1].data() + (j - low_[1] + shape_[1] - 1) * kAllProbes,
                                  probes_[2].data() + (k - low_[2] + shape_[2] - 1) * kAllProbes, at_, probed);
  const Word* const words = words_.data();
  const Word* to = words + (j * shape_[2] + k) * shape_[0] + first;
  const std::int32_t* probes_i = probes_[0].data() + (first - low_[0] + shape_[0] - 1) * kAllProbes;
  Index n_steps = 0;
  for (Index i = first; i <= last; ++i, ++to, probes_i += kAllProbes) {
    if (!is_far && std::abs(i - low_[0]) < kNear[stage]) continue;
    ++n_steps;
    __m256i wanted = _mm256_and_si256(own, load_words(to));
    if (is_none(wanted)) continue;
    for (int p = 0; p < kProbes[stage]; ++p)
      wanted = _mm256_and_si256(wanted, load_words(words + probed[p] + probes_i[p]));
    if (is_none(wanted)) continue;
    __m256i seen = wanted;
    for (int p = kProbes[stage]; p < kProbes[stage + 1]; ++p)
      seen = _mm256_and_si256(seen, load_words(words + probed[p] + probes_i[p]));
    const __m256i hidden = _mm256_andnot_si256(seen, wanted);
    if (is_none(hidden)) continue;
    store_words(counts_.waiting[counts_.n_waiting], hidden);
    counts_.count_waiting();
  }
  n_steps_ += n_steps;
}

template <int order, int stage>
VOXKERNEL_AVX2 void LabelTiles::probe_avx2(Index j, Index k) {
  const Index first = first_[j * shape_[2] + k], last = last_[j * shape_[2] + k];
  const bool is_far = std::max(std::abs(j - low_[1]), std::abs(k - low_[2])) >= kNear[stage];
  const Index near = is_far ? 0 : kNear[stage];
  const __m256i own = load_words(own_);
  Sums sums{load_words(counts_.sums[0]), load_words(counts_.sums[1])};
  Index probed[kAllProbes + 1];
  add_offsets<kProbes[stage + 1]>(probes_[1].data() + (j - low_[1] + shape_[1] - 1) * kAllProbes,
                                  probes_[2].data() + (k - low_[2] + shape_[2] - 1) * kAllProbes, at_, probed);
  const Word* const to = words_.data() + (j * shape_[2] + k) * shape_[0] + low_[0];
  if (last >= low_[0])
    probe_way<order, stage, true>(to, probed, std::max(first - low_[0], near), last - low_[0], own, sums);
  if (first < low_[0]) {
    probe_way<order, stage, false>(to, probed, std::max(low_[0] - last, std::max<Index>(near, 1)), low_[0] - first, own,
                                   sums);
  }
  store_words(counts_.sums[0], sums.ones);
  store_words(counts_.sums[1], sums.twos);
}
#endif

}  // namespace voxkernel
