// The points are divided like a kd-tree, each part with the planes that may cross it. A plane that all of a part
// violates for certain is added once; one that none of it does is dropped (plane_bounds.h, 3). Signs within rounding
// of a plane are decided with expansions. Weights are integers.
#include "violation.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "avx2.h"
#include "plane_list.h"
#include "predicates.h"

namespace voxkernel {
namespace {

constexpr Index kLeafPoints = 12;
constexpr Index kBlockOfPlanes = 8192;  // of few points, which are not divided: no more planes are copied at a time
constexpr double kUnit = 0x1p-53;

struct FacetView {
  double *x, *y, *z, *offset, *error;
  Index *weight, *row;
};

class FacetList : public ColumnSet<5, 2> {
 public:
  using ColumnSet::ColumnSet;
  FacetView view() const {
    return {numbers<0>(), numbers<1>(), numbers<2>(), numbers<3>(), numbers<4>(), integers<0>(), integers<1>()};
  }
};

// The bounding box of a part: centre and half edges, a little widened; |x| + |y| + |z| is at most `far`.
struct PartBox {
  double low[3], high[3];
  double centre[3], half[3];
  double far = 0.0;

  PartBox(const PointSet& points, Span<const Index> order) {
    for (int k = 0; k < 3; ++k) {
      low[k] = std::numeric_limits<double>::infinity();
      high[k] = -low[k];
      for (Index j = 0; j < order.size(); ++j) {
        const double v = points.local[k][order[j]];
        low[k] = std::min(low[k], v);
        high[k] = std::max(high[k], v);
      }
      far += std::max(std::abs(low[k]), std::abs(high[k]));
      centre[k] = 0.5 * (low[k] + high[k]);
      half[k] = 0.5 * (1.0 + 1e-12) * (high[k] - low[k]);
    }
  }
  int longest_axis() const {
    int axis = 0;
    for (int k = 1; k < 3; ++k) {
      if (high[k] - low[k] > high[axis] - low[axis]) axis = k;
    }
    return axis;
  }
};

// Reorders order[first..last] so that the keys of the lower half are not above those of the upper half.
Index divide(Span<Index> order, Doubles keys, Index first, Index last) {
  const Index target = (first + last) / 2;
  Index low = first, high = last - 1;
  while (low < high) {
    const double pivot = keys[order[(low + high) / 2]];
    Index i = low, j = high;
    while (i <= j) {
      while (keys[order[i]] < pivot) ++i;
      while (keys[order[j]] > pivot) --j;
      if (i <= j) std::swap(order[i++], order[j--]);
    }
    if (target <= j) {
      high = j;
    } else if (target >= i) {
      low = i;
    } else {
      break;
    }
  }
  return target;
}

// What a list of planes comes to: the weight that is violated for certain, and where those end that are not settled.
struct Settled {
  Index certain;
  Index end;
};

// Copies the planes first..last that may cross the box to `last` and after.
Settled settle_plain(const FacetView& p, Index first, Index last, const PartBox& box) {
  Index certain = 0, at = last;
  for (Index t = first; t < last; ++t) {
    const double s = (p.x[t] * box.centre[0] + p.y[t] * box.centre[1] + p.z[t] * box.centre[2]) - p.offset[t];
    const double r = std::abs(p.x[t]) * box.half[0] + std::abs(p.y[t]) * box.half[1] + std::abs(p.z[t]) * box.half[2] +
                     2.0 * p.error[t] * (box.far + 1.0);
    if (s > r) certain += p.weight[t];
    p.x[at] = p.x[t];
    p.y[at] = p.y[t];
    p.z[at] = p.z[t];
    p.offset[at] = p.offset[t];
    p.error[at] = p.error[t];
    p.weight[at] = p.weight[t];
    p.row[at] = p.row[t];
    at += !(s > r || s < -r);
  }
  return {certain, at};
}

struct Place {
  double x, y, z;
  double extent;  // |x| + |y| + |z| + 1
};

// What a point violates for certain, and whether it is within rounding of a plane.
struct PointWeight {
  Index certain;
  bool is_near;
};

PointWeight point_weight_plain(const FacetView& planes, Index first, Index last, const Place& place) {
  const FacetView p = planes;
  Index certain = 0, near = 0;
  for (Index t = first; t < last; ++t) {
    const double s = (p.x[t] * place.x + p.y[t] * place.y + p.z[t] * place.z) - p.offset[t];
    const double e = p.error[t] * place.extent;
    certain += s > e ? p.weight[t] : 0;
    near += s > e || s < -e ? 0 : 1;
  }
  return {certain, near > 0};
}

#ifdef VOXKERNEL_HAS_AVX2

VOXKERNEL_AVX2_INLINE __m256d magnitude(__m256d values) { return _mm256_andnot_pd(_mm256_set1_pd(-0.0), values); }

VOXKERNEL_AVX2 Settled settle_avx2(const FacetView& planes, Index first, Index last, const PartBox& box) {
  const FacetView p = planes;
  const __m256d cx = _mm256_set1_pd(box.centre[0]), cy = _mm256_set1_pd(box.centre[1]),
                cz = _mm256_set1_pd(box.centre[2]);
  const __m256d hx = _mm256_set1_pd(box.half[0]), hy = _mm256_set1_pd(box.half[1]), hz = _mm256_set1_pd(box.half[2]);
  const __m256d two = _mm256_set1_pd(2.0), far = _mm256_set1_pd(box.far + 1.0);
  __m256i certain = _mm256_setzero_si256();
  Index at = last;
  for (Index t = first; t < last; t += 4) {
    const __m256d x = _mm256_loadu_pd(p.x + t), y = _mm256_loadu_pd(p.y + t), z = _mm256_loadu_pd(p.z + t),
                  offset = _mm256_loadu_pd(p.offset + t), error = _mm256_loadu_pd(p.error + t);
    const __m256i weight = load(p.weight + t);
    const __m256d along =
        _mm256_add_pd(_mm256_add_pd(_mm256_mul_pd(x, cx), _mm256_mul_pd(y, cy)), _mm256_mul_pd(z, cz));
    const __m256d s = _mm256_sub_pd(along, offset);
    const __m256d reach = _mm256_add_pd(_mm256_add_pd(_mm256_mul_pd(magnitude(x), hx), _mm256_mul_pd(magnitude(y), hy)),
                                        _mm256_mul_pd(magnitude(z), hz));
    const __m256d r = _mm256_add_pd(reach, _mm256_mul_pd(_mm256_mul_pd(two, error), far));
    const Index rest = last - t;
    const __m256d above = _mm256_cmp_pd(s, r, _CMP_GT_OQ);
    certain = _mm256_add_epi64(certain, kept_if(above, _mm256_and_si256(weight, first_lanes(rest))));
    const int settled = _mm256_movemask_pd(_mm256_or_pd(above, _mm256_cmp_pd(s, negative(r), _CMP_LT_OQ)));
    const int mask = ~settled & (rest < 4 ? (1 << rest) - 1 : 15);
    const __m256i order = lanes_to_front(mask);
    store_kept(p.x + at, _mm256_castpd_si256(x), order);
    store_kept(p.y + at, _mm256_castpd_si256(y), order);
    store_kept(p.z + at, _mm256_castpd_si256(z), order);
    store_kept(p.offset + at, _mm256_castpd_si256(offset), order);
    store_kept(p.error + at, _mm256_castpd_si256(error), order);
    store_kept(p.weight + at, weight, order);
    store_kept(p.row + at, load(p.row + t), order);
    at += __builtin_popcount(mask);
  }
  return {sum(certain), at};
}

VOXKERNEL_AVX2 PointWeight point_weight_avx2(const FacetView& planes, Index first, Index last, const Place& place) {
  const FacetView p = planes;
  const __m256d px = _mm256_set1_pd(place.x), py = _mm256_set1_pd(place.y), pz = _mm256_set1_pd(place.z),
                extent = _mm256_set1_pd(place.extent);
  __m256i certain = _mm256_setzero_si256();
  __m256d clear = _mm256_castsi256_pd(_mm256_set1_epi64x(-1));
  const auto add = [&](Index t, __m256i lanes) VOXKERNEL_AVX2 __attribute__((always_inline)) {
    const __m256d xy =
        _mm256_add_pd(_mm256_mul_pd(_mm256_loadu_pd(p.x + t), px), _mm256_mul_pd(_mm256_loadu_pd(p.y + t), py));
    const __m256d s =
        _mm256_sub_pd(_mm256_add_pd(xy, _mm256_mul_pd(_mm256_loadu_pd(p.z + t), pz)), _mm256_loadu_pd(p.offset + t));
    const __m256d e = _mm256_mul_pd(_mm256_loadu_pd(p.error + t), extent);
    const __m256i weight = _mm256_and_si256(load(p.weight + t), lanes);
    certain = _mm256_add_epi64(certain, kept_if(_mm256_cmp_pd(s, e, _CMP_GT_OQ), weight));
    // |s| > e is s > e or s < -e, also where something is not a number.
    const __m256d is_clear = _mm256_cmp_pd(magnitude(s), e, _CMP_GT_OQ);
    const __m256d beyond = _mm256_castsi256_pd(_mm256_xor_si256(lanes, _mm256_set1_epi64x(-1)));
    clear = _mm256_and_pd(clear, _mm256_or_pd(is_clear, beyond));
  };
  const __m256i all = _mm256_set1_epi64x(-1);
  Index t = first;
  for (; t + 4 <= last; t += 4) add(t, all);
  if (t < last) add(t, first_lanes(last - t));
  return {sum(certain), _mm256_movemask_pd(clear) != 15};
}

#endif

Settled settle(const FacetView& p, Index first, Index last, const PartBox& box) {
#ifdef VOXKERNEL_HAS_AVX2
  if (has_avx2) return settle_avx2(p, first, last, box);
#endif
  return settle_plain(p, first, last, box);
}

PointWeight point_weight(const FacetView& p, Index first, Index last, const Place& place) {
#ifdef VOXKERNEL_HAS_AVX2
  if (has_avx2) return point_weight_avx2(p, first, last, place);
#endif
  return point_weight_plain(p, first, last, place);
}

// Points lower..upper of the order with the planes first..last; both halves of a part share its list.
struct Part {
  Index lower, upper;
  Index first, last;
  Index certain;
};

class Divided {
 public:
  Divided(const PointSet& points, const FacetPlanes& planes, bool by_expansions, Span<Index> order, Span<Index> sums,
          Stop& stop)
      : points_(points),
        planes_(planes),
        by_expansions_(by_expansions),
        order_(order),
        sums_(sums),
        is_divided_(order.size() > kLeafPoints),
        list_(3 * (is_divided_ ? planes.offsets.size() : std::min(kBlockOfPlanes, planes.offsets.size())) + 1024),
        stop_(stop) {}

  std::vector<Index> run() {
    const Index n = planes_.offsets.size(), step = is_divided_ ? n : kBlockOfPlanes;
    for (const Index point : order_) sums_[point] = 0;
    for (Index first = 0; first < n && order_.size() > 0; first += step) weigh_points(first, std::min(first + step, n));
    return std::move(open_pairs_);
  }

 private:
  // Adds what the points violate of the planes first..last.
  void weigh_points(Index first, Index last) {
    take(first, last);
    parts_.push_back({0, order_.size(), 0, last - first, 0});
    while (!parts_.empty()) {
      Part part = parts_.back();
      parts_.pop_back();
      stop_.poll(part.upper - part.lower + part.last - part.first);
      if (part.upper - part.lower > 1) {
        const PartBox box(points_, Span<Index>(order_).part(part.lower, part.upper));
        narrow(part, box);
        if (part.upper - part.lower > kLeafPoints && part.last > part.first) {
          const Index cut = divide(order_, points_.local[box.longest_axis()], part.lower, part.upper);
          parts_.push_back({cut, part.upper, part.first, part.last, part.certain});
          parts_.push_back({part.lower, cut, part.first, part.last, part.certain});
          continue;
        }
      }
      for (Index j = part.lower; j < part.upper; ++j) weigh_point(order_[j], part);
    }
  }

  void take(Index first, Index last) {
    const FacetView p = list_.view();
    for (Index i = first; i < last; ++i) {
      const Index at = i - first;
      const double* a = planes_.normals[i];
      p.x[at] = a[0];
      p.y[at] = a[1];
      p.z[at] = a[2];
      p.offset[at] = planes_.offsets[i];
      p.error[at] = planes_.errors[i] + 4.0 * kUnit;
      p.weight[at] = planes_.weights[i];
      p.row[at] = i;
    }
  }

  // Leaves a part the planes that may cross its box.
  void narrow(Part& part, const PartBox& box) {
    list_.reserve(part.last + (part.last - part.first));
    const Settled settled = settle(list_.view(), part.first, part.last, box);
    part.certain += settled.certain;
    part.first = part.last;
    part.last = settled.end;
  }

  void weigh_point(Index point, const Part& part) {
    stop_.poll(part.last - part.first);
    const FacetView p = list_.view();
    Place place{points_.local[0][point], points_.local[1][point], points_.local[2][point], 0.0};
    place.extent = std::abs(place.x) + std::abs(place.y) + std::abs(place.z) + 1.0;
    const PointWeight weight = point_weight(p, part.first, part.last, place);
    sums_[point] += part.certain + weight.certain;
    if (!weight.is_near) return;
    for (Index t = part.first; t < part.last; ++t) {
      const double s = (p.x[t] * place.x + p.y[t] * place.y + p.z[t] * place.z) - p.offset[t];
      const double e = p.error[t] * place.extent;
      if (s > e || s < -e) continue;
      const Index row = p.row[t];
      if (!by_expansions_ || planes_.corners(row, 0) < 0) {
        open_pairs_.push_back(point);
        open_pairs_.push_back(row);
      } else if (is_above(planes_.corners[row], points_.world[point])) {
        sums_[point] += p.weight[t];
      }
      stop_.poll(64);
    }
  }

  bool is_above(const Index* corners, const double* place) const {
    const Points v = planes_.vertices;
    return orientation(v[corners[0]], v[corners[1]], v[corners[2]], place) > 0.0;
  }

  const PointSet& points_;
  const FacetPlanes& planes_;
  bool by_expansions_;
  Span<Index> order_, sums_;
  bool is_divided_;
  FacetList list_;
  std::vector<Part> parts_;
  std::vector<Index> open_pairs_;
  Stop& stop_;
};

}  // namespace

// Fills sums[i] with the weight that point i violates, for the points of `order` (which is reordered).
//
// Planes without corners, and all with `by_expansions` false, are left to exact arithmetic elsewhere: returns the
// pairs (point, plane) whose sign is open.
std::vector<Index> violated_weights(const PointSet& points, const FacetPlanes& planes, bool by_expansions,
                                    Span<Index> order, Span<Index> sums, Stop& stop) {
  return Divided(points, planes, by_expansions, order, sums, stop).run();
}

// Tells for every triangle whether the point is strictly on its outer side; every sign exact.
void faces_away(Points vertices, Triangles faces, const double* point, Span<bool> away, Stop& stop) {
  for (Index f = 0; f < faces.size(); ++f) {
    stop.poll(16);
    const double *a = vertices[faces(f, 0)], *b = vertices[faces(f, 1)], *c = vertices[faces(f, 2)];
    away[f] = orientation(a, b, c, point) > 0.0;
  }
}

}  // namespace voxkernel
