// A cell can do no better than what all of it violates for certain; its centre can do no worse than what is
// violated there. Weights are integers, so both bounds are exact.
#include "center.h"

#include <cmath>
#include <vector>

#include "avx2.h"
#include "plane_list.h"

namespace voxkernel {
namespace {

struct PaddedView {
  double *x, *y, *z, *reach, *pad, *value;
  Index* weight;
};

class PaddedList {
 public:
  explicit PaddedList(Index size)
      : x_(size), y_(size), z_(size), reach_(size), pad_(size), value_(size), weight_(size) {}
  PaddedView view() const {
    return {x_.data(), y_.data(), z_.data(), reach_.data(), pad_.data(), value_.data(), weight_.data()};
  }
  void reserve(Index needed) {
    for (Column<double>* column : {&x_, &y_, &z_, &reach_, &pad_, &value_}) column->reserve(needed + kSlack);
    weight_.reserve(needed + kSlack);
  }

 private:
  Column<double> x_, y_, z_, reach_, pad_, value_;
  Column<Index> weight_;
};

// What all of a cell violates for certain, and what its centre violates at most.
struct Bounds {
  Index certain = 0;
  Index at_centre = 0;
};

// Whether the cell is certainly outside the domain, its centre certainly inside, or neither is known.
Side domain_side(const PaddedView& p, Index first, Index last, Step step, double blur) {
  Side side = Side::inside;
  for (Index t = first; t < last; ++t) {
    const double s = p.value[t] + (p.x[t] * step.x + p.y[t] * step.y + p.z[t] * step.z);
    if (s > step.h * p.reach[t] + p.pad[t]) return Side::outside;
    if (s > -p.pad[t] - blur) side = Side::crossing;
  }
  return side;
}

Bounds bounds_of(const PaddedView& planes, Index first, Index last, Step step, double blur) {
  const PaddedView p = planes;
  Bounds sums;
  for (Index t = first; t < last; ++t) {
    const double s = p.value[t] + (p.x[t] * step.x + p.y[t] * step.y + p.z[t] * step.z);
    sums.certain += s > step.h * p.reach[t] + p.pad[t] ? p.weight[t] : 0;
    sums.at_centre += s > -p.pad[t] - blur ? p.weight[t] : 0;
  }
  return sums;
}

Index keep_crossing_plain(const PaddedView& p, Index first, Index last, Index at, Step step) {
  for (Index t = first; t < last; ++t) {
    const double s = p.value[t] + (p.x[t] * step.x + p.y[t] * step.y + p.z[t] * step.z);
    const double r = step.h * p.reach[t] + p.pad[t];
    p.x[at] = p.x[t];
    p.y[at] = p.y[t];
    p.z[at] = p.z[t];
    p.reach[at] = p.reach[t];
    p.pad[at] = p.pad[t];
    p.value[at] = s;
    p.weight[at] = p.weight[t];
    at += -r <= s && s <= r;
  }
  return at;
}

#ifdef VOXKERNEL_HAS_AVX2

VOXKERNEL_AVX2 Side domain_side_avx2(const PaddedView& planes, Index first, Index last, Step step, double blur_) {
  const PaddedView p = planes;
  const __m256d sx = _mm256_set1_pd(step.x), sy = _mm256_set1_pd(step.y), sz = _mm256_set1_pd(step.z),
                h = _mm256_set1_pd(step.h), blur = _mm256_set1_pd(blur_);
  int near = 0;
  for (Index t = first; t < last; t += 4) {
    const __m256d xy =
        _mm256_add_pd(_mm256_mul_pd(_mm256_loadu_pd(p.x + t), sx), _mm256_mul_pd(_mm256_loadu_pd(p.y + t), sy));
    const __m256d s =
        _mm256_add_pd(_mm256_loadu_pd(p.value + t), _mm256_add_pd(xy, _mm256_mul_pd(_mm256_loadu_pd(p.z + t), sz)));
    const __m256d pad = _mm256_loadu_pd(p.pad + t);
    const __m256d r = _mm256_add_pd(_mm256_mul_pd(h, _mm256_loadu_pd(p.reach + t)), pad);
    const int lanes = last - t < 4 ? (1 << (last - t)) - 1 : 15;
    if (_mm256_movemask_pd(_mm256_cmp_pd(s, r, _CMP_GT_OQ)) & lanes) return Side::outside;
    near |= _mm256_movemask_pd(_mm256_cmp_pd(s, _mm256_sub_pd(negative(pad), blur), _CMP_GT_OQ)) & lanes;
  }
  return near ? Side::crossing : Side::inside;
}

// Children 7, 0, 6, 1 with `is_same`, where x and y have the same sign, else 5, 2, 4, 3. Opposite children differ in
// the sign of the whole step, so that they share what is added.
template <bool is_same>
VOXKERNEL_AVX2 void bounds_of_four(const PaddedView& planes, Index first, Index last, double half, double blur_,
                                   Bounds* const (&children)[4]) {
  const PaddedView p = planes;
  const __m256d h = _mm256_set1_pd(half), blur = _mm256_set1_pd(blur_);
  __m256i certain0 = _mm256_setzero_si256(), certain1 = certain0, certain2 = certain0, certain3 = certain0;
  __m256i centre0 = certain0, centre1 = certain0, centre2 = certain0, centre3 = certain0;
  const auto add = [&](Index t, __m256i weight) VOXKERNEL_AVX2 __attribute__((always_inline)) {
    const __m256d x = _mm256_mul_pd(_mm256_loadu_pd(p.x + t), h), y = _mm256_mul_pd(_mm256_loadu_pd(p.y + t), h),
                  z = _mm256_mul_pd(_mm256_loadu_pd(p.z + t), h);
    const __m256d xy = is_same ? _mm256_add_pd(x, y) : _mm256_sub_pd(x, y);
    const __m256d up = _mm256_add_pd(xy, z), down = _mm256_sub_pd(xy, z);
    const __m256d value = _mm256_loadu_pd(p.value + t), pad = _mm256_loadu_pd(p.pad + t);
    const __m256d r = _mm256_add_pd(_mm256_mul_pd(h, _mm256_loadu_pd(p.reach + t)), pad);
    const __m256d near = _mm256_sub_pd(negative(pad), blur);
    __m256d s = _mm256_add_pd(value, up);
    certain0 = _mm256_add_epi64(certain0, kept_if(_mm256_cmp_pd(s, r, _CMP_GT_OQ), weight));
    centre0 = _mm256_add_epi64(centre0, kept_if(_mm256_cmp_pd(s, near, _CMP_GT_OQ), weight));
    s = _mm256_sub_pd(value, up);
    certain1 = _mm256_add_epi64(certain1, kept_if(_mm256_cmp_pd(s, r, _CMP_GT_OQ), weight));
    centre1 = _mm256_add_epi64(centre1, kept_if(_mm256_cmp_pd(s, near, _CMP_GT_OQ), weight));
    s = _mm256_add_pd(value, down);
    certain2 = _mm256_add_epi64(certain2, kept_if(_mm256_cmp_pd(s, r, _CMP_GT_OQ), weight));
    centre2 = _mm256_add_epi64(centre2, kept_if(_mm256_cmp_pd(s, near, _CMP_GT_OQ), weight));
    s = _mm256_sub_pd(value, down);
    certain3 = _mm256_add_epi64(certain3, kept_if(_mm256_cmp_pd(s, r, _CMP_GT_OQ), weight));
    centre3 = _mm256_add_epi64(centre3, kept_if(_mm256_cmp_pd(s, near, _CMP_GT_OQ), weight));
  };
  Index t = first;
  for (; t + 4 <= last; t += 4) add(t, load(p.weight + t));
  if (t < last) add(t, _mm256_and_si256(load(p.weight + t), first_lanes(last - t)));
  *children[0] = {sum(certain0), sum(centre0)};
  *children[1] = {sum(certain1), sum(centre1)};
  *children[2] = {sum(certain2), sum(centre2)};
  *children[3] = {sum(certain3), sum(centre3)};
}

VOXKERNEL_AVX2 Index keep_crossing_avx2(const PaddedView& planes, Index first, Index last, Index at, Step step) {
  const PaddedView p = planes;
  const __m256d sx = _mm256_set1_pd(step.x), sy = _mm256_set1_pd(step.y), sz = _mm256_set1_pd(step.z),
                h = _mm256_set1_pd(step.h);
  for (Index t = first; t < last; t += 4) {
    const __m256d x = _mm256_loadu_pd(p.x + t), y = _mm256_loadu_pd(p.y + t), z = _mm256_loadu_pd(p.z + t),
                  reach = _mm256_loadu_pd(p.reach + t), pad = _mm256_loadu_pd(p.pad + t);
    const __m256d xy = _mm256_add_pd(_mm256_mul_pd(x, sx), _mm256_mul_pd(y, sy));
    const __m256d s = _mm256_add_pd(_mm256_loadu_pd(p.value + t), _mm256_add_pd(xy, _mm256_mul_pd(z, sz)));
    const __m256d r = _mm256_add_pd(_mm256_mul_pd(h, reach), pad);
    const int lanes = last - t < 4 ? (1 << (last - t)) - 1 : 15;
    const __m256d crossing = _mm256_and_pd(_mm256_cmp_pd(s, r, _CMP_LE_OQ), _mm256_cmp_pd(negative(r), s, _CMP_LE_OQ));
    const int mask = _mm256_movemask_pd(crossing) & lanes;
    const __m256i order = lanes_to_front(mask);
    store_kept(p.x + at, _mm256_castpd_si256(x), order);
    store_kept(p.y + at, _mm256_castpd_si256(y), order);
    store_kept(p.z + at, _mm256_castpd_si256(z), order);
    store_kept(p.reach + at, _mm256_castpd_si256(reach), order);
    store_kept(p.pad + at, _mm256_castpd_si256(pad), order);
    store_kept(p.value + at, _mm256_castpd_si256(s), order);
    store_kept(p.weight + at, load(p.weight + t), order);
    at += __builtin_popcount(mask);
  }
  return at;
}

#endif

Side side_of_domain(const PaddedView& p, Index first, Index last, Step step, double blur) {
#ifdef VOXKERNEL_HAS_AVX2
  if (has_avx2) return domain_side_avx2(p, first, last, step, blur);
#endif
  return domain_side(p, first, last, step, blur);
}

// Fills the bounds of the children of bit c in `wanted`; h is their half edge.
void bounds_of_children(const PaddedView& p, Index first, Index last, double h, double blur, int wanted,
                        Bounds (&children)[8]) {
#ifdef VOXKERNEL_HAS_AVX2
  if (has_avx2) {
    Bounds* const same[4] = {&children[7], &children[0], &children[6], &children[1]};
    Bounds* const other[4] = {&children[5], &children[2], &children[4], &children[3]};
    if (wanted & 0b11000011) bounds_of_four<true>(p, first, last, h, blur, same);
    if (wanted & 0b00111100) bounds_of_four<false>(p, first, last, h, blur, other);
    return;
  }
#endif
  for (int c = 0; c < 8; ++c) {
    if (wanted >> c & 1) children[c] = bounds_of(p, first, last, step_to_child(c, h), blur);
  }
}

// Copies the planes first..last that the cell may cross to `at` and after; returns where they end.
Index keep_crossing(const PaddedView& p, Index first, Index last, Index at, Step step) {
#ifdef VOXKERNEL_HAS_AVX2
  if (has_avx2) return keep_crossing_avx2(p, first, last, at, step);
#endif
  return keep_crossing_plain(p, first, last, at, step);
}

// A cell whose children are open, its lists of domain and facet planes, and the children it has in the domain, those
// of the best centres first.
struct Cell {
  double centre[3];
  Index begin, middle, end;
  Index violated;
  int n_children, next;
  int children[8];
  Index certain[8];  // by position in `children`
};

class CenterSearch {
 public:
  CenterSearch(const PaddedPlanes& planes, double blur, Index best, const Search& search, double* center,
               double* open_cell, Stop& stop)
      : planes_(3 * planes.offsets.size() + 1024),
        cells_(search.max_level + 2),
        found_{best, best, 0},
        least_open_(best),
        search_(search),
        blur_(blur),
        center_(center),
        open_cell_(open_cell),
        stop_(stop) {
    const PaddedView p = planes_.view();
    const Index n = planes.offsets.size();
    for (Index i = 0; i < n; ++i) {
      const double* a = planes.normals[i];
      p.x[i] = a[0];
      p.y[i] = a[1];
      p.z[i] = a[2];
      p.reach[i] = planes.reach[i];
      p.pad[i] = planes.pads[i];
      p.value[i] = 0.5 * (a[0] + a[1] + a[2]) - planes.offsets[i];
      p.weight[i] = planes.weights[i];
    }
    std::fill_n(cells_[0].centre, 3, 0.5);
    cells_[0].middle = planes.n_domain;
    cells_[0].end = n;
  }

  Least run() {
    look_at_children(0);
    for (int level = 0; level >= 0;) {
      if (cells_[level].next == cells_[level].n_children) {
        --level;
      } else if (enter_child(level)) {
        look_at_children(++level);
      }
    }
    found_.lower = std::min(found_.lower, found_.best);
    return found_;
  }

 private:
  static double half_edge_of_children(int level) { return 0.25 / static_cast<double>(Index{1} << level); }

  void look_at_children(int level) {
    Cell& cell = cells_[level];
    const double h = half_edge_of_children(level);
    const PaddedView p = planes_.view();
    stop_.poll(8 * (cell.end - cell.begin) + 8);
    Side sides[8];
    int wanted = 0;
    for (int c = 0; c < 8; ++c) {
      sides[c] = side_of_domain(p, cell.begin, cell.middle, step_to_child(c, h), blur_);
      if (sides[c] != Side::outside) wanted |= 1 << c;
    }
    Bounds bounds[8];
    bounds_of_children(p, cell.middle, cell.end, h, blur_, wanted, bounds);
    Index keys[8];
    int m = 0;
    for (int c = 0; c < 8; ++c) {
      if (sides[c] == Side::outside) continue;
      const Index at_centre = bounds[c].at_centre + cell.violated;
      if (sides[c] == Side::inside && at_centre < found_.best) {
        found_.best = at_centre;
        to_centre(cell, step_to_child(c, h), center_);
      }
      int at = m++;
      for (; at > 0 && keys[at - 1] > at_centre; --at) {
        keys[at] = keys[at - 1];
        cell.children[at] = cell.children[at - 1];
        cell.certain[at] = cell.certain[at - 1];
      }
      keys[at] = at_centre;
      cell.children[at] = c;
      cell.certain[at] = bounds[c].certain + cell.violated;
    }
    cell.n_children = m;
    cell.next = 0;
    found_.n_cells += m;
  }

  // Closes the next child of a cell where it can do no better, or is as far as the search goes; whether it is to be
  // divided and has become the next cell.
  bool enter_child(int level) {
    Cell& cell = cells_[level];
    const int at = cell.next++;
    const Index sure = cell.certain[at];
    const Step step = step_to_child(cell.children[at], half_edge_of_children(level));
    const Index enough =
        found_.best - std::max(search_.gap, static_cast<Index>(search_.ratio * static_cast<double>(found_.best)));
    const bool is_last = level + 1 >= search_.max_level;
    if (sure >= enough || is_last || found_.n_cells >= search_.max_cells) {
      found_.lower = std::min(found_.lower, sure);
      if (sure < enough && sure < least_open_ && is_last) {
        least_open_ = sure;
        to_centre(cell, step, open_cell_);
        open_cell_[3] = step.h;
      }
      return false;
    }
    stop_.poll(cell.end - cell.begin);
    planes_.reserve(cell.end + (cell.end - cell.begin));
    const PaddedView p = planes_.view();
    Cell& child = cells_[level + 1];
    child.begin = cell.end;
    child.middle = keep_crossing(p, cell.begin, cell.middle, cell.end, step);
    child.end = keep_crossing(p, cell.middle, cell.end, child.middle, step);
    child.violated = sure;
    to_centre(cell, step, child.centre);
    return true;
  }

  static void to_centre(const Cell& cell, Step step, double* centre) {
    centre[0] = cell.centre[0] + step.x;
    centre[1] = cell.centre[1] + step.y;
    centre[2] = cell.centre[2] + step.z;
  }

  PaddedList planes_;
  std::vector<Cell> cells_;
  Least found_;
  Index least_open_;
  Search search_;
  double blur_;
  double* center_;
  double* open_cell_;
  Stop& stop_;
};

}  // namespace

// Finds the least violated weight in the unit cube as closely as `search` says.
//
// `best` is a weight known to be reached; when a centre does better, it is written to `center`. `blur` is by how much
// a centre may move later. Children are visited in the order of what their centre violates, so that a good point is
// found early. `lower` is certain; it is further below than asked for when cells of `max_level` stay open or
// `max_cells` have been looked at. `open_cell` is then centre and half edge of the least violated cell of `max_level`.
Least least_violated(const PaddedPlanes& planes, double blur, Index best, const Search& search, double* center,
                     double* open_cell, Stop& stop) {
  return CenterSearch(planes, blur, best, search, center, open_cell, stop).run();
}

}  // namespace voxkernel
