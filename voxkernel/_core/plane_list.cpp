#include "plane_list.h"

#include "avx2.h"

namespace voxkernel {
namespace {

// Long lists are looked at in pieces: a cell that is outside is often known to be so after the first.
constexpr Index kChunk = 512;

Side domain_side_plain(const PlaneView& p, Index first, Index last, Step step) {
  Side side = Side::inside;
  for (Index t = first; t < last; ++t) {
    const double s = p.value[t] + (p.x[t] * step.x + p.y[t] * step.y + p.z[t] * step.z);
    const double r = step.h * p.reach[t];
    if (s > r) return Side::outside;
    if (s >= -r) side = Side::crossing;
  }
  return side;
}

Index keep_crossing_plain(const PlaneView& p, Index first, Index last, Index at, Step step) {
  for (Index t = first; t < last; ++t) {
    const double s = p.value[t] + (p.x[t] * step.x + p.y[t] * step.y + p.z[t] * step.z);
    const double r = step.h * p.reach[t];
    p.x[at] = p.x[t];
    p.y[at] = p.y[t];
    p.z[at] = p.z[t];
    p.reach[at] = p.reach[t];
    p.value[at] = s;
    p.weight[at] = p.weight[t];
    at += -r <= s && s <= r;
  }
  return at;
}

#ifdef VOXKERNEL_HAS_AVX2

VOXKERNEL_AVX2_INLINE __m256d value_at(const PlaneView& p, Index t, __m256d sx, __m256d sy, __m256d sz) {
  const __m256d xy =
      _mm256_add_pd(_mm256_mul_pd(_mm256_loadu_pd(p.x + t), sx), _mm256_mul_pd(_mm256_loadu_pd(p.y + t), sy));
  return _mm256_add_pd(_mm256_loadu_pd(p.value + t), _mm256_add_pd(xy, _mm256_mul_pd(_mm256_loadu_pd(p.z + t), sz)));
}

VOXKERNEL_AVX2 Side domain_side_avx2(const PlaneView& planes, Index first, Index last, Step step) {
  const PlaneView p = planes;
  const __m256d sx = _mm256_set1_pd(step.x), sy = _mm256_set1_pd(step.y), sz = _mm256_set1_pd(step.z),
                h = _mm256_set1_pd(step.h);
  int crossing = 0;
  for (Index t = first; t < last; t += 4) {
    const __m256d s = value_at(p, t, sx, sy, sz);
    const __m256d r = _mm256_mul_pd(h, _mm256_loadu_pd(p.reach + t));
    const int lanes = last - t < 4 ? (1 << (last - t)) - 1 : 15;
    if (_mm256_movemask_pd(_mm256_cmp_pd(s, r, _CMP_GT_OQ)) & lanes) return Side::outside;
    crossing |= _mm256_movemask_pd(_mm256_cmp_pd(s, negative(r), _CMP_GE_OQ)) & lanes;
  }
  return crossing ? Side::crossing : Side::inside;
}

// Children 7, 0, 6, 1 with `is_same`, where x and y have the same sign, else 5, 2, 4, 3. Opposite children differ in
// the sign of the whole step, so that they share what is added.
template <bool is_same>
VOXKERNEL_AVX2 void weights_of_four(const PlaneView& planes, Index first, Index last, double half,
                                    Weights* const (&children)[4]) {
  const PlaneView p = planes;
  const __m256d h = _mm256_set1_pd(half);
  __m256i certain0 = _mm256_setzero_si256(), certain1 = certain0, certain2 = certain0, certain3 = certain0;
  __m256i possible0 = certain0, possible1 = certain0, possible2 = certain0, possible3 = certain0;
  const auto add = [&](Index t, __m256i weight) VOXKERNEL_AVX2 __attribute__((always_inline)) {
    const __m256d x = _mm256_mul_pd(_mm256_loadu_pd(p.x + t), h), y = _mm256_mul_pd(_mm256_loadu_pd(p.y + t), h),
                  z = _mm256_mul_pd(_mm256_loadu_pd(p.z + t), h);
    const __m256d xy = is_same ? _mm256_add_pd(x, y) : _mm256_sub_pd(x, y);
    const __m256d up = _mm256_add_pd(xy, z), down = _mm256_sub_pd(xy, z);
    const __m256d value = _mm256_loadu_pd(p.value + t);
    const __m256d r = _mm256_mul_pd(h, _mm256_loadu_pd(p.reach + t)), minus_r = negative(r);
    __m256d s = _mm256_add_pd(value, up);
    certain0 = _mm256_add_epi64(certain0, kept_if(_mm256_cmp_pd(s, r, _CMP_GT_OQ), weight));
    possible0 = _mm256_add_epi64(possible0, kept_if(_mm256_cmp_pd(s, minus_r, _CMP_GE_OQ), weight));
    s = _mm256_sub_pd(value, up);
    certain1 = _mm256_add_epi64(certain1, kept_if(_mm256_cmp_pd(s, r, _CMP_GT_OQ), weight));
    possible1 = _mm256_add_epi64(possible1, kept_if(_mm256_cmp_pd(s, minus_r, _CMP_GE_OQ), weight));
    s = _mm256_add_pd(value, down);
    certain2 = _mm256_add_epi64(certain2, kept_if(_mm256_cmp_pd(s, r, _CMP_GT_OQ), weight));
    possible2 = _mm256_add_epi64(possible2, kept_if(_mm256_cmp_pd(s, minus_r, _CMP_GE_OQ), weight));
    s = _mm256_sub_pd(value, down);
    certain3 = _mm256_add_epi64(certain3, kept_if(_mm256_cmp_pd(s, r, _CMP_GT_OQ), weight));
    possible3 = _mm256_add_epi64(possible3, kept_if(_mm256_cmp_pd(s, minus_r, _CMP_GE_OQ), weight));
  };
  Index t = first;
  for (; t + 4 <= last; t += 4) add(t, load(p.weight + t));
  if (t < last) add(t, _mm256_and_si256(load(p.weight + t), first_lanes(last - t)));
  children[0]->certain += sum(certain0), children[0]->possible += sum(possible0);
  children[1]->certain += sum(certain1), children[1]->possible += sum(possible1);
  children[2]->certain += sum(certain2), children[2]->possible += sum(possible2);
  children[3]->certain += sum(certain3), children[3]->possible += sum(possible3);
}

VOXKERNEL_AVX2 Index keep_crossing_avx2(const PlaneView& planes, Index first, Index last, Index at, Step step) {
  const PlaneView p = planes;
  const __m256d sx = _mm256_set1_pd(step.x), sy = _mm256_set1_pd(step.y), sz = _mm256_set1_pd(step.z),
                h = _mm256_set1_pd(step.h);
  for (Index t = first; t < last; t += 4) {
    const __m256d s = value_at(p, t, sx, sy, sz);
    const __m256d r = _mm256_mul_pd(h, _mm256_loadu_pd(p.reach + t));
    const int lanes = last - t < 4 ? (1 << (last - t)) - 1 : 15;
    const __m256d crossing = _mm256_and_pd(_mm256_cmp_pd(s, r, _CMP_LE_OQ), _mm256_cmp_pd(negative(r), s, _CMP_LE_OQ));
    const int mask = _mm256_movemask_pd(crossing) & lanes;
    const __m256i order = lanes_to_front(mask);
    store_kept(p.x + at, load_bits(p.x + t), order);
    store_kept(p.y + at, load_bits(p.y + t), order);
    store_kept(p.z + at, load_bits(p.z + t), order);
    store_kept(p.reach + at, load_bits(p.reach + t), order);
    store_kept(p.value + at, _mm256_castpd_si256(s), order);
    store_kept(p.weight + at, load(p.weight + t), order);
    at += __builtin_popcount(mask);
  }
  return at;
}

#endif

}  // namespace

Side domain_side(const PlaneView& planes, Index first, Index last, Step step) {
#ifdef VOXKERNEL_HAS_AVX2
  if (has_avx2) return domain_side_avx2(planes, first, last, step);
#endif
  return domain_side_plain(planes, first, last, step);
}

Weights weights_of(const PlaneView& planes, Index first, Index last, Step step) {
  const PlaneView p = planes;
  Weights sums;
  for (Index t = first; t < last; ++t) {
    const double s = p.value[t] + (p.x[t] * step.x + p.y[t] * step.y + p.z[t] * step.z);
    const double r = step.h * p.reach[t];
    sums.certain += s > r ? p.weight[t] : 0;
    sums.possible += s >= -r ? p.weight[t] : 0;
  }
  return sums;
}

void weights_of_children(const PlaneView& planes, Index first, Index last, double h, Index most, int wanted,
                         Weights (&children)[8]) {
  for (Weights& child : children) child = Weights{};
#ifdef VOXKERNEL_HAS_AVX2
  if (has_avx2) {
    constexpr int kGroups[2][4] = {{7, 0, 6, 1}, {5, 2, 4, 3}};
    for (int g = 0; g < 2; ++g) {
      Weights* group[4];
      int open = 0;
      for (int k = 0; k < 4; ++k) {
        group[k] = &children[kGroups[g][k]];
        open |= wanted >> kGroups[g][k] & 1;
      }
      for (Index t = first; t < last && open; t += kChunk) {
        const Index end = std::min(t + kChunk, last);
        g == 0 ? weights_of_four<true>(planes, t, end, h, group) : weights_of_four<false>(planes, t, end, h, group);
        open = 0;
        for (int k = 0; k < 4; ++k) open |= (wanted >> kGroups[g][k] & 1) && group[k]->certain <= most;
      }
    }
    return;
  }
#endif
  for (int c = 0; c < 8; ++c) {
    if (!(wanted >> c & 1)) continue;
    const Step step = step_to_child(c, h);
    for (Index t = first; t < last && children[c].certain <= most; t += kChunk) {
      const Weights more = weights_of(planes, t, std::min(t + kChunk, last), step);
      children[c].certain += more.certain;
      children[c].possible += more.possible;
    }
  }
}

Index keep_crossing(const PlaneView& planes, Index first, Index last, Index at, Step step) {
#ifdef VOXKERNEL_HAS_AVX2
  if (has_avx2) return keep_crossing_avx2(planes, first, last, at, step);
#endif
  return keep_crossing_plain(planes, first, last, at, step);
}

}  // namespace voxkernel
