#include "plane_list.h"

#include "avx2.h"

namespace voxkernel {
namespace {

// Long lists are looked at in pieces where there is a limit: a cell beyond it is often known to be so after the first.
Index piece_of(Index n, Index most) { return most == kNoLimit ? n : std::min<Index>(n, 512); }

double value_at(const PlaneView& p, Index t, const Step& step) {
  return p.value[t] + (p.x[t] * step.x + p.y[t] * step.y + p.z[t] * step.z);
}
template <bool has_pad>
double radius(const PlaneView& p, Index t, double h) {
  return has_pad ? h * p.reach[t] + p.pad[t] : h * p.reach[t];
}
bool may_be_violated(CellLimits, const PlaneView&, Index, double s, double r) { return s >= -r; }
bool may_be_violated(CentreLimits limits, const PlaneView& p, Index t, double s, double) {
  return s > -p.pad[t] - limits.blur;
}

template <typename Limits>
Side domain_side_plain(const PlaneView& p, Index first, Index last, const Step& step, const Limits& limits) {
  Side side = Side::inside;
  for (Index t = first; t < last; ++t) {
    const double s = value_at(p, t, step), r = radius<Limits::has_pad>(p, t, step.h);
    if (s > r) return Side::outside;
    if (may_be_violated(limits, p, t, s, r)) side = Side::crossing;
  }
  return side;
}

// With `is_search` it ends at the first plane t that all of the cell violates, and returns -1 - t.
template <bool has_pad, bool has_weight, bool is_search>
Index keep_plain(const PlaneView& planes, Index first, Index last, Index at, const Step& step) {
  const PlaneView p = planes;
  for (Index t = first; t < last; ++t) {
    const double s = value_at(p, t, step), r = radius<has_pad>(p, t, step.h);
    if (is_search && s > r) return -1 - t;
    p.x[at] = p.x[t];
    p.y[at] = p.y[t];
    p.z[at] = p.z[t];
    p.reach[at] = p.reach[t];
    p.value[at] = s;
    if constexpr (has_pad) p.pad[at] = p.pad[t];
    if constexpr (has_weight) p.weight[at] = p.weight[t];
    at += -r <= s && s <= r;
  }
  return at;
}

#ifdef VOXKERNEL_HAS_AVX2

struct Steps {
  __m256d x, y, z, h;
};
VOXKERNEL_AVX2_INLINE Steps four_times(const Step& step) {
  return {_mm256_set1_pd(step.x), _mm256_set1_pd(step.y), _mm256_set1_pd(step.z), _mm256_set1_pd(step.h)};
}
VOXKERNEL_AVX2_INLINE __m256d value_of_four(const PlaneView& p, Index t, const Steps& step) {
  const __m256d xy =
      _mm256_add_pd(_mm256_mul_pd(_mm256_loadu_pd(p.x + t), step.x), _mm256_mul_pd(_mm256_loadu_pd(p.y + t), step.y));
  return _mm256_add_pd(_mm256_loadu_pd(p.value + t),
                       _mm256_add_pd(xy, _mm256_mul_pd(_mm256_loadu_pd(p.z + t), step.z)));
}
template <bool has_pad>
VOXKERNEL_AVX2_INLINE __m256d radius_of_four(const PlaneView& p, Index t, __m256d h) {
  const __m256d r = _mm256_mul_pd(h, _mm256_loadu_pd(p.reach + t));
  if constexpr (has_pad) return _mm256_add_pd(r, _mm256_loadu_pd(p.pad + t));
  return r;
}

// Where planes may be violated, in two steps: the first is the same for all children of a cell.
VOXKERNEL_AVX2_INLINE __m256d least_of_four(CellLimits, const PlaneView&, Index, __m256d r) { return negative(r); }
VOXKERNEL_AVX2_INLINE __m256d least_of_four(CentreLimits limits, const PlaneView& p, Index t, __m256d) {
  return _mm256_sub_pd(negative(_mm256_loadu_pd(p.pad + t)), _mm256_set1_pd(limits.blur));
}
VOXKERNEL_AVX2_INLINE __m256d may_be_violated(CellLimits, __m256d s, __m256d least) {
  return _mm256_cmp_pd(s, least, _CMP_GE_OQ);
}
VOXKERNEL_AVX2_INLINE __m256d may_be_violated(CentreLimits, __m256d s, __m256d least) {
  return _mm256_cmp_pd(s, least, _CMP_GT_OQ);
}
VOXKERNEL_AVX2_INLINE int lanes_before(Index t, Index last) { return last - t < 4 ? (1 << (last - t)) - 1 : 15; }

template <typename Limits>
VOXKERNEL_AVX2 Side domain_side_avx2(const PlaneView& planes, Index first, Index last, const Step& step_,
                                     const Limits& limits) {
  const PlaneView p = planes;
  const Steps step = four_times(step_);
  int crossing = 0;
  for (Index t = first; t < last; t += 4) {
    const __m256d s = value_of_four(p, t, step), r = radius_of_four<Limits::has_pad>(p, t, step.h);
    const int lanes = lanes_before(t, last);
    if (_mm256_movemask_pd(_mm256_cmp_pd(s, r, _CMP_GT_OQ)) & lanes) return Side::outside;
    crossing |= _mm256_movemask_pd(may_be_violated(limits, s, least_of_four(limits, p, t, r))) & lanes;
  }
  return crossing ? Side::crossing : Side::inside;
}

// Children 7, 0, 6, 1 with `is_same`, where x and y have the same sign, else 5, 2, 4, 3. Opposite children differ in
// the sign of the whole step, so that they share what is added.
template <bool is_same, typename Limits>
VOXKERNEL_AVX2 void weights_of_four(const PlaneView& planes, Index first, Index last, double half, const Limits& limits,
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
    const __m256d r = radius_of_four<Limits::has_pad>(p, t, h), least = least_of_four(limits, p, t, r);
    __m256d s = _mm256_add_pd(value, up);
    certain0 = _mm256_add_epi64(certain0, kept_if(_mm256_cmp_pd(s, r, _CMP_GT_OQ), weight));
    possible0 = _mm256_add_epi64(possible0, kept_if(may_be_violated(limits, s, least), weight));
    s = _mm256_sub_pd(value, up);
    certain1 = _mm256_add_epi64(certain1, kept_if(_mm256_cmp_pd(s, r, _CMP_GT_OQ), weight));
    possible1 = _mm256_add_epi64(possible1, kept_if(may_be_violated(limits, s, least), weight));
    s = _mm256_add_pd(value, down);
    certain2 = _mm256_add_epi64(certain2, kept_if(_mm256_cmp_pd(s, r, _CMP_GT_OQ), weight));
    possible2 = _mm256_add_epi64(possible2, kept_if(may_be_violated(limits, s, least), weight));
    s = _mm256_sub_pd(value, down);
    certain3 = _mm256_add_epi64(certain3, kept_if(_mm256_cmp_pd(s, r, _CMP_GT_OQ), weight));
    possible3 = _mm256_add_epi64(possible3, kept_if(may_be_violated(limits, s, least), weight));
  };
  Index t = first;
  for (; t + 4 <= last; t += 4) add(t, load(p.weight + t));
  if (t < last) add(t, _mm256_and_si256(load(p.weight + t), first_lanes(last - t)));
  children[0]->certain += sum(certain0), children[0]->possible += sum(possible0);
  children[1]->certain += sum(certain1), children[1]->possible += sum(possible1);
  children[2]->certain += sum(certain2), children[2]->possible += sum(possible2);
  children[3]->certain += sum(certain3), children[3]->possible += sum(possible3);
}

// Four children at a time, as long as one of them is still wanted.
template <typename Limits>
void weights_of_children_avx2(const PlaneView& planes, Index first, Index last, double h, Index most, int wanted,
                              const Limits& limits, Weights (&children)[8]) {
  const Index piece = piece_of(last - first, most);
  constexpr int kGroups[2][4] = {{7, 0, 6, 1}, {5, 2, 4, 3}};
  for (int g = 0; g < 2; ++g) {
    Weights* group[4];
    bool is_open = false;
    for (int k = 0; k < 4; ++k) {
      group[k] = &children[kGroups[g][k]];
      is_open |= (wanted >> kGroups[g][k] & 1) != 0;
    }
    for (Index t = first; t < last && is_open; t += piece) {
      const Index end = std::min(t + piece, last);
      g == 0 ? weights_of_four<true>(planes, t, end, h, limits, group)
             : weights_of_four<false>(planes, t, end, h, limits, group);
      is_open = false;
      for (int k = 0; k < 4; ++k) is_open |= (wanted >> kGroups[g][k] & 1) != 0 && group[k]->certain <= most;
    }
  }
}

VOXKERNEL_AVX2 void crossed_children_avx2(const PlaneView& planes, Index n, double h, std::uint8_t* children) {
  const PlaneView p = planes;
  for (Index t = 0; t < n; t += 4) {
    const __m256d r = radius_of_four<true>(p, t, _mm256_set1_pd(h)), least = negative(r);
    __m256i crossed = _mm256_setzero_si256();
    for (int c = 0; c < 8; ++c) {
      const __m256d s = value_of_four(p, t, four_times(child_step(c, h)));
      const __m256d is_crossed = _mm256_and_pd(_mm256_cmp_pd(s, r, _CMP_LE_OQ), _mm256_cmp_pd(least, s, _CMP_LE_OQ));
      crossed = _mm256_or_si256(crossed, kept_if(is_crossed, _mm256_set1_epi64x(1 << c)));
    }
    alignas(32) std::int64_t lanes[4];
    _mm256_store_si256(reinterpret_cast<__m256i*>(lanes), crossed);
    for (Index k = 0; k < std::min<Index>(4, n - t); ++k) children[t + k] = static_cast<std::uint8_t>(lanes[k]);
  }
}

template <bool has_pad, bool has_weight, bool is_search>
VOXKERNEL_AVX2 Index keep_avx2(const PlaneView& planes, Index first, Index last, Index at, const Step& step_) {
  const PlaneView p = planes;
  const Steps step = four_times(step_);
  for (Index t = first; t < last; t += 4) {
    const __m256d s = value_of_four(p, t, step), r = radius_of_four<has_pad>(p, t, step.h);
    const int lanes = lanes_before(t, last);
    if constexpr (is_search) {
      const int above = _mm256_movemask_pd(_mm256_cmp_pd(s, r, _CMP_GT_OQ)) & lanes;
      if (above) return -1 - (t + __builtin_ctz(above));
    }
    const __m256d from_below = _mm256_cmp_pd(negative(r), s, _CMP_LE_OQ);
    const int mask =
        _mm256_movemask_pd(is_search ? from_below : _mm256_and_pd(_mm256_cmp_pd(s, r, _CMP_LE_OQ), from_below)) & lanes;
    const __m256i order = lanes_to_front(mask);
    store_kept(p.x + at, load_bits(p.x + t), order);
    store_kept(p.y + at, load_bits(p.y + t), order);
    store_kept(p.z + at, load_bits(p.z + t), order);
    store_kept(p.reach + at, load_bits(p.reach + t), order);
    store_kept(p.value + at, _mm256_castpd_si256(s), order);
    if constexpr (has_pad) store_kept(p.pad + at, load_bits(p.pad + t), order);
    if constexpr (has_weight) store_kept(p.weight + at, load(p.weight + t), order);
    at += __builtin_popcount(mask);
  }
  return at;
}

#endif

template <bool has_pad, bool has_weight, bool is_search>
Index keep(const PlaneView& planes, Index first, Index last, Index at, const Step& step) {
#ifdef VOXKERNEL_HAS_AVX2
  if (has_avx2) return keep_avx2<has_pad, has_weight, is_search>(planes, first, last, at, step);
#endif
  return keep_plain<has_pad, has_weight, is_search>(planes, first, last, at, step);
}

}  // namespace

template <typename Limits>
Side domain_side(const PlaneView& planes, Index first, Index last, const Step& step, const Limits& limits) {
#ifdef VOXKERNEL_HAS_AVX2
  if (has_avx2) return domain_side_avx2(planes, first, last, step, limits);
#endif
  return domain_side_plain(planes, first, last, step, limits);
}

template <typename Limits>
Weights weights_of(const PlaneView& planes, Index first, Index last, const Step& step, const Limits& limits) {
  const PlaneView p = planes;
  Weights sums;
  for (Index t = first; t < last; ++t) {
    const double s = value_at(p, t, step), r = radius<Limits::has_pad>(p, t, step.h);
    sums.certain += s > r ? p.weight[t] : 0;
    sums.possible += may_be_violated(limits, p, t, s, r) ? p.weight[t] : 0;
  }
  return sums;
}

template <typename Limits>
void weights_of_children(const PlaneView& planes, Index first, Index last, double h, Index most, int wanted,
                         const Limits& limits, Weights (&children)[8]) {
  for (Weights& child : children) child = Weights{};
#ifdef VOXKERNEL_HAS_AVX2
  if (has_avx2) return weights_of_children_avx2(planes, first, last, h, most, wanted, limits, children);
#endif
  const Index piece = piece_of(last - first, most);
  for (int c = 0; c < 8; ++c) {
    if (!(wanted >> c & 1)) continue;
    const Step step = child_step(c, h);
    for (Index t = first; t < last && children[c].certain <= most; t += piece) {
      const Weights more = weights_of(planes, t, std::min(t + piece, last), step, limits);
      children[c].certain += more.certain;
      children[c].possible += more.possible;
    }
  }
}

void crossed_children(const PlaneView& planes, Index n, double h, std::uint8_t* children) {
#ifdef VOXKERNEL_HAS_AVX2
  if (has_avx2) return crossed_children_avx2(planes, n, h, children);
#endif
  const PlaneView p = planes;
  for (Index t = 0; t < n; ++t) {
    const double r = radius<true>(p, t, h);
    int crossed = 0;
    for (int c = 0; c < 8; ++c) {
      const double s = value_at(p, t, child_step(c, h));
      crossed |= static_cast<int>(-r <= s && s <= r) << c;
    }
    children[t] = static_cast<std::uint8_t>(crossed);
  }
}

template <bool has_pad>
Index keep_crossing(const PlaneView& planes, Index first, Index last, Index at, const Step& step) {
  return keep<has_pad, true, false>(planes, first, last, at, step);
}

Index keep_undecided(const PlaneView& planes, Index first, Index last, Index at, const Step& step) {
  return keep<true, false, true>(planes, first, last, at, step);
}

template Side domain_side(const PlaneView&, Index, Index, const Step&, const CellLimits&);
template Side domain_side(const PlaneView&, Index, Index, const Step&, const CentreLimits&);
template Weights weights_of(const PlaneView&, Index, Index, const Step&, const CellLimits&);
template Weights weights_of(const PlaneView&, Index, Index, const Step&, const CentreLimits&);
template void weights_of_children(const PlaneView&, Index, Index, double, Index, int, const CellLimits&,
                                  Weights (&)[8]);
template void weights_of_children(const PlaneView&, Index, Index, double, Index, int, const CentreLimits&,
                                  Weights (&)[8]);
template Index keep_crossing<false>(const PlaneView&, Index, Index, Index, const Step&);
template Index keep_crossing<true>(const PlaneView&, Index, Index, Index, const Step&);

}  // namespace voxkernel
