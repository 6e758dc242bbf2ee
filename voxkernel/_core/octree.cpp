// Cells are cubes of the unit cube. A half-space is (a, b): a . u <= b, with |a| = 1 up to rounding. For
// a cell with centre c and half edge h, s = a . c - b and r = h |a|_1: s > r + pad proves that the whole
// cell is outside, s < -r - pad that it is inside. `pad` covers all rounding, so both are certain.
#include "octree.h"

#include <cmath>
#include <type_traits>
#include <utility>

#include "avx2.h"
#include "plane_list.h"

namespace voxkernel {
namespace {

struct ExactView {
  double *x, *y, *z, *reach, *pad, *value;
};

class ExactList {
 public:
  explicit ExactList(Index size) : x_(size), y_(size), z_(size), reach_(size), pad_(size), value_(size) {}
  ExactView view() const { return {x_.data(), y_.data(), z_.data(), reach_.data(), pad_.data(), value_.data()}; }
  void reserve(Index needed) {
    for (Column<double>* column : {&x_, &y_, &z_, &reach_, &pad_, &value_}) column->reserve(needed + kSlack);
  }

 private:
  Column<double> x_, y_, z_, reach_, pad_, value_;
};

// What a half-space leaves of an 8^3 brick: in the column (x, y) the voxels on one side of a plane, z below or above
// a limit that is linear in x and y.
struct BrickPlane {
  double low, high;  // where the value is -r, r, along z, in the column (0, 0)
  double step_x, step_y;
  bool is_up;

  BrickPlane(const ExactView& p, Index t, double half) {
    const double ax = 2.0 * half * p.x[t], ay = 2.0 * half * p.y[t];
    double az = 2.0 * half * p.z[t];
    double r = half * p.reach[t] + p.pad[t] + 1e-13 * half;
    if (std::abs(az) < 2e-9 * half) {
      // Nearly parallel to the columns: tilt it a little and pay with the pad.
      az = az >= 0 ? 2e-9 * half : -2e-9 * half;
      r += 1.6e-8 * half;
    }
    const double corner = p.value[t] - 3.5 * (ax + ay + az);  // the value at voxel (0, 0, 0)
    const double inverse = 1.0 / az;
    low = (-r - corner) * inverse;
    high = (r - corner) * inverse;
    step_x = -ax * inverse;
    step_y = -ay * inverse;
    is_up = az > 0;
  }
};

struct Brick {
  alignas(16) Word inside[8];
  alignas(16) Word possible[8];

  Content content(Word some) const {
    if (some == 0) return Content::nothing;
    Word full = kAllBits;
    for (const Word word : inside) full &= word;
    return full == kAllBits ? Content::everything : Content::some;
  }
};

int in_column(double limit) { return static_cast<int>(std::min(8.0, std::max(0.0, limit))); }

// Fills the masks of a brick: voxels inside all half-spaces first..last, voxels not certainly outside one.
Content fill_plain(const ExactView& p, Index first, Index last, double half, Brick& brick) {
  std::fill_n(brick.inside, 8, kAllBits);
  std::fill_n(brick.possible, 8, kAllBits);
  Word some = kAllBits;
  for (Index t = first; t < last && some != 0; ++t) {
    const BrickPlane plane(p, t, half);
    some = 0;
    for (int x = 0; x < 8; ++x) {
      Word in = 0, may = 0;
      for (int y = 0; y < 8; ++y) {
        const double shift = plane.step_x * x + plane.step_y * y;
        // Up: inside where z < low, possible where z <= high. Down: inside where z > low, possible where z >= high.
        const int up = in_column(std::ceil((plane.is_up ? plane.low : plane.high) + shift));
        const int down = in_column(std::floor((plane.is_up ? plane.high : plane.low) + shift) + 1.0);
        const Word below_up = (Word{1} << up) - 1, below_down = (Word{1} << down) - 1;
        in |= (plane.is_up ? below_up : 0xFF & ~below_down) << (8 * y);
        may |= (plane.is_up ? below_down : 0xFF & ~below_up) << (8 * y);
      }
      brick.inside[x] &= in;
      brick.possible[x] &= may;
      some |= brick.possible[x];
    }
  }
  return brick.content(some);
}

#ifdef VOXKERNEL_HAS_AVX2

// Bits of the z below k, and of the others, for k = 0 .. 8.
alignas(16) constexpr std::uint8_t kBelow[16] = {0, 1, 3, 7, 15, 31, 63, 127, 255};
alignas(16) constexpr std::uint8_t kFromThere[16] = {255, 254, 252, 248, 240, 224, 192, 128, 0};

// Limits of four columns, rounded up, or down and plus 1.
template <bool is_ceil>
VOXKERNEL_AVX2_INLINE __m128i limits_of_four(__m256d limit) {
  const __m256d rounded = is_ceil ? _mm256_ceil_pd(limit) : _mm256_add_pd(_mm256_floor_pd(limit), _mm256_set1_pd(1.0));
  return _mm256_cvttpd_epi32(_mm256_min_pd(_mm256_max_pd(rounded, _mm256_setzero_pd()), _mm256_set1_pd(8.0)));
}

// Masks of the columns of two x: one byte each.
template <bool is_ceil>
VOXKERNEL_AVX2_INLINE __m128i columns_of_two(__m256d limit, const __m256d (&shift)[4], __m128i table) {
  const __m128i one = _mm_packs_epi32(limits_of_four<is_ceil>(_mm256_add_pd(limit, shift[0])),
                                      limits_of_four<is_ceil>(_mm256_add_pd(limit, shift[1])));
  const __m128i two = _mm_packs_epi32(limits_of_four<is_ceil>(_mm256_add_pd(limit, shift[2])),
                                      limits_of_four<is_ceil>(_mm256_add_pd(limit, shift[3])));
  return _mm_shuffle_epi8(table, _mm_packus_epi16(one, two));
}

VOXKERNEL_AVX2 Content fill_avx2(const ExactView& planes, Index first, Index last, double half, Brick& brick) {
  const ExactView p = planes;
  __m128i inside[4], possible[4];
  for (int k = 0; k < 4; ++k) inside[k] = possible[k] = _mm_set1_epi8(-1);
  bool some = true;
  for (Index t = first; t < last && some; ++t) {
    const BrickPlane plane(p, t, half);
    const __m256d low = _mm256_set1_pd(plane.low), high = _mm256_set1_pd(plane.high);
    const __m256d step_x = _mm256_set1_pd(plane.step_x), step_y = _mm256_set1_pd(plane.step_y);
    const __m256d along_y[2] = {_mm256_mul_pd(step_y, _mm256_setr_pd(0, 1, 2, 3)),
                                _mm256_mul_pd(step_y, _mm256_setr_pd(4, 5, 6, 7))};
    const __m128i table = _mm_load_si128(reinterpret_cast<const __m128i*>(plane.is_up ? kBelow : kFromThere));
    __m128i any = _mm_setzero_si128();
    const auto each_pair = [&](auto is_up) VOXKERNEL_AVX2 __attribute__((always_inline)) {
      constexpr bool up = decltype(is_up)::value;
#pragma GCC unroll 4
      for (int k = 0; k < 4; ++k) {
        const __m256d x0 = _mm256_mul_pd(step_x, _mm256_set1_pd(2 * k)),
                      x1 = _mm256_mul_pd(step_x, _mm256_set1_pd(2 * k + 1));
        const __m256d shift[4] = {_mm256_add_pd(x0, along_y[0]), _mm256_add_pd(x0, along_y[1]),
                                  _mm256_add_pd(x1, along_y[0]), _mm256_add_pd(x1, along_y[1])};
        inside[k] = _mm_and_si128(inside[k], columns_of_two<up>(low, shift, table));
        possible[k] = _mm_and_si128(possible[k], columns_of_two<!up>(high, shift, table));
        any = _mm_or_si128(any, possible[k]);
      }
    };
    plane.is_up ? each_pair(std::true_type{}) : each_pair(std::false_type{});
    some = !_mm_testz_si128(any, any);
  }
  for (int k = 0; k < 4; ++k) {
    _mm_store_si128(reinterpret_cast<__m128i*>(brick.inside + 2 * k), inside[k]);
    _mm_store_si128(reinterpret_cast<__m128i*>(brick.possible + 2 * k), possible[k]);
  }
  return brick.content(some);
}

#endif

// Copies the planes first..last that the cell may cross to `at` and after; returns where they end. When the cell is
// certainly outside one of them, returns -1 - its index.
Index keep_undecided_plain(const ExactView& p, Index first, Index last, Index at, Step step) {
  for (Index t = first; t < last; ++t) {
    const double s = p.value[t] + (p.x[t] * step.x + p.y[t] * step.y + p.z[t] * step.z);
    const double r = step.h * p.reach[t] + p.pad[t];
    if (s > r) return -1 - t;
    p.x[at] = p.x[t];
    p.y[at] = p.y[t];
    p.z[at] = p.z[t];
    p.reach[at] = p.reach[t];
    p.pad[at] = p.pad[t];
    p.value[at] = s;
    at += s >= -r;
  }
  return at;
}

#ifdef VOXKERNEL_HAS_AVX2

VOXKERNEL_AVX2 Index keep_undecided_avx2(const ExactView& planes, Index first, Index last, Index at, Step step) {
  const ExactView p = planes;
  const __m256d sx = _mm256_set1_pd(step.x), sy = _mm256_set1_pd(step.y), sz = _mm256_set1_pd(step.z),
                h = _mm256_set1_pd(step.h);
  for (Index t = first; t < last; t += 4) {
    const __m256d x = _mm256_loadu_pd(p.x + t), y = _mm256_loadu_pd(p.y + t), z = _mm256_loadu_pd(p.z + t),
                  reach = _mm256_loadu_pd(p.reach + t), pad = _mm256_loadu_pd(p.pad + t);
    const __m256d xy = _mm256_add_pd(_mm256_mul_pd(x, sx), _mm256_mul_pd(y, sy));
    const __m256d s = _mm256_add_pd(_mm256_loadu_pd(p.value + t), _mm256_add_pd(xy, _mm256_mul_pd(z, sz)));
    const __m256d r = _mm256_add_pd(_mm256_mul_pd(h, reach), pad);
    const int lanes = last - t < 4 ? (1 << (last - t)) - 1 : 15;
    const int above = _mm256_movemask_pd(_mm256_cmp_pd(s, r, _CMP_GT_OQ)) & lanes;
    if (above) return -1 - (t + __builtin_ctz(above));
    const int mask = _mm256_movemask_pd(_mm256_cmp_pd(s, negative(r), _CMP_GE_OQ)) & lanes;
    const __m256i order = lanes_to_front(mask);
    store_kept(p.x + at, _mm256_castpd_si256(x), order);
    store_kept(p.y + at, _mm256_castpd_si256(y), order);
    store_kept(p.z + at, _mm256_castpd_si256(z), order);
    store_kept(p.reach + at, _mm256_castpd_si256(reach), order);
    store_kept(p.pad + at, _mm256_castpd_si256(pad), order);
    store_kept(p.value + at, _mm256_castpd_si256(s), order);
    at += __builtin_popcount(mask);
  }
  return at;
}

#endif

Index keep_undecided(const ExactView& p, Index first, Index last, Index at, Step step) {
#ifdef VOXKERNEL_HAS_AVX2
  if (has_avx2) return keep_undecided_avx2(p, first, last, at, step);
#endif
  return keep_undecided_plain(p, first, last, at, step);
}

Content fill(const ExactView& p, Index first, Index last, double half, Brick& brick) {
#ifdef VOXKERNEL_HAS_AVX2
  if (has_avx2) return fill_avx2(p, first, last, half, brick);
#endif
  return fill_plain(p, first, last, half, brick);
}

// The plane that decided is tried first for the next sibling.
void swap_planes(const ExactView& p, Index i, Index j) {
  for (double* column : {p.x, p.y, p.z, p.reach, p.pad, p.value}) std::swap(column[i], column[j]);
}

// A cell whose children are open, with the range of its planes.
struct Cell {
  Index ijk[3];
  Index begin, end;
  int next;  // child
};

class ExactOctree {
 public:
  ExactOctree(Index n_planes, int depth, bool count_only, Stop& stop)
      : planes_(3 * n_planes + 1024), cells_(depth + 1), depth_(depth), count_only_(count_only), stop_(stop) {}

  ExactCells run(Points normals, Doubles offsets, Doubles reach, Doubles pads) {
    const Index end = planes_of_cube(normals, offsets, reach, pads);
    cells_[0] = {{0, 0, 0}, 0, end, 0};
    if (end < 0) return std::move(found_);
    const bool is_open = enter(0, end, cells_[0].ijk, 0);
    for (int level = is_open ? 0 : -1; level >= 0;) {
      if (cells_[level].next == 8) {
        --level;
      } else if (look_at_child(level)) {
        ++level;
      }
    }
    return std::move(found_);
  }

 private:
  // The list of the whole cube; returns its end, or -1 when the cube is certainly outside a plane.
  Index planes_of_cube(Points normals, Doubles offsets, Doubles reach, Doubles pads) {
    const ExactView p = planes_.view();
    Index end = 0;
    for (Index i = 0; i < offsets.size(); ++i) {
      stop_.poll();
      const double* a = normals[i];
      const double s = 0.5 * (a[0] + a[1] + a[2]) - offsets[i];
      const double r = 0.5 * reach[i] + pads[i];
      if (s > r) return -1;
      if (!(s >= -r)) continue;
      p.x[end] = a[0];
      p.y[end] = a[1];
      p.z[end] = a[2];
      p.reach[end] = reach[i];
      p.pad[end] = pads[i];
      p.value[end] = s;
      ++end;
    }
    return end;
  }

  // Tests the next child of a cell; whether it is open too and has become the cell of the next level.
  bool look_at_child(int level) {
    Cell& cell = cells_[level];
    const int c = cell.next++;
    const Step step = step_to_child(c, 0.5 / static_cast<double>(Index{1} << (level + 1)));
    stop_.poll(16 + cell.end - cell.begin);
    planes_.reserve(cell.end + (cell.end - cell.begin));
    const ExactView p = planes_.view();
    const Index end = keep_undecided(p, cell.begin, cell.end, cell.end, step);
    if (end < 0) {
      swap_planes(p, cell.begin, -1 - end);
      return false;
    }
    Cell& child = cells_[level + 1];
    child_cell(cell.ijk, c, child.ijk);
    child.begin = cell.end;
    child.end = end;
    child.next = 0;
    return enter(child.begin, end, child.ijk, level + 1);
  }

  // Settles a cell with the planes first..last where nothing is left to divide; whether there is.
  bool enter(Index first, Index last, const Index* ijk, int level) {
    const int exponent = depth_ - level;
    Content content = Content::everything;
    if (first < last) {
      if (exponent > 3) return true;
      stop_.poll(64 * (last - first));
      content = fill(planes_.view(), first, last, 0.5 / static_cast<double>(Index{1} << depth_), brick_);
    }
    // A cube that is a brick stays one, whatever is in it.
    if (content == Content::everything && (level > 0 || first == last)) {
      found_.n_inside += Index{1} << (3 * exponent);
      if (!count_only_ || level == 0) found_.tiles.add(ijk, exponent);
    } else if (content != Content::nothing) {
      add_leaf(ijk, level);
    }
    return false;
  }

  void add_leaf(const Index* ijk, int level) {
    for (int x = 0; x < 8; ++x) {
      brick_.possible[x] &= ~brick_.inside[x];
      found_.n_inside += ones(brick_.inside[x]);
      found_.n_boundary += ones(brick_.possible[x]);
    }
    if (!count_only_ || level == 0) found_.leaves.add(ijk, brick_.inside, brick_.possible);
  }

  ExactList planes_;
  std::vector<Cell> cells_;
  Brick brick_{};
  ExactCells found_;
  int depth_;
  bool count_only_;
  Stop& stop_;
};

}  // namespace

// Classifies the unit cube down to 2**depth voxels an edge; bricks of 8^3 are the last level. With `count_only`
// there are no tiles and leaves, but the whole cube where it is one of them.
ExactCells exact_cells(Points normals, Doubles offsets, Doubles reach, Doubles pads, int depth, bool count_only,
                       Stop& stop) {
  return ExactOctree(offsets.size(), depth, count_only, stop).run(normals, offsets, reach, pads);
}

}  // namespace voxkernel
