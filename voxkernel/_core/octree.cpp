// The lists are those of descent.h, with pads and without weights. A cell that is certainly outside one half-space
// needs no other: children are tested one by one, and the half-space that decided is tried first for the next.
#include "octree.h"

#include <cmath>
#include <type_traits>
#include <utility>

#include "avx2.h"
#include "brick_columns.h"
#include "descent.h"

namespace voxkernel {
namespace {

// What a half-space leaves of an 8^3 brick: in the column (x, y) the voxels below its limits where its value grows
// with z, above them elsewhere.
ColumnLimits limits_of(const PlaneView& p, Index t, double half) {
  return {p, t, half, half * p.reach[t] + p.pad[t] + kLimitRounding * half};
}

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
Content fill_plain(const PlaneView& p, Index first, Index last, double half, Brick& brick) {
  std::fill_n(brick.inside, 8, kAllBits);
  std::fill_n(brick.possible, 8, kAllBits);
  Word some = kAllBits;
  for (Index t = first; t < last && some != 0; ++t) {
    const ColumnLimits plane = limits_of(p, t, half);
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

VOXKERNEL_AVX2 Content fill_avx2(const PlaneView& planes, Index first, Index last, double half, Brick& brick) {
  const PlaneView p = planes;
  __m128i inside[4], possible[4];
  for (int k = 0; k < 4; ++k) inside[k] = possible[k] = _mm_set1_epi8(-1);
  bool some = true;
  for (Index t = first; t < last && some; ++t) {
    const ColumnLimits plane = limits_of(p, t, half);
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

Content fill(const PlaneView& p, Index first, Index last, double half, Brick& brick) {
#ifdef VOXKERNEL_HAS_AVX2
  if (has_avx2) return fill_avx2(p, first, last, half, brick);
#endif
  return fill_plain(p, first, last, half, brick);
}

// The plane that decided is tried first for the next sibling.
void swap_planes(const PlaneView& p, Index i, Index j) {
  for (double* column : {p.x, p.y, p.z, p.reach, p.pad, p.value}) std::swap(column[i], column[j]);
}

class ExactOctree {
 public:
  ExactOctree(Index n_planes, int depth, bool count_only, Stop& stop)
      : descent_(n_planes, depth + 2, stop), depth_(depth), count_only_(count_only), stop_(stop) {}

  ExactCells run(Points normals, Doubles offsets, Doubles reach, Doubles pads) {
    const Index end = planes_of_cube(normals, offsets, reach, pads);
    if (end < 0) return std::move(found_);
    if (enter(descent_.open_first(kCube, 0, end), kCube)) {
      descent_.run(kCube, [this](int slot) { return enter_child(slot); });
    }
    return std::move(found_);
  }

 private:
  static constexpr int kCube = 1;  // the slot of the cube itself

  // The list of the whole cube; returns its end, or -1 when the cube is certainly outside a plane.
  Index planes_of_cube(Points normals, Doubles offsets, Doubles reach, Doubles pads) {
    const PlaneView p = descent_.planes.view();
    Index end = 0;
    for (Index i = 0; i < offsets.size(); ++i) {
      stop_.poll();
      const double s = value_in_cube(normals[i], offsets[i]), r = 0.5 * reach[i] + pads[i];
      if (s > r) return -1;
      if (!(s >= -r)) continue;
      p.set(end, normals[i], reach[i], s);
      p.pad[end] = pads[i];
      ++end;
    }
    return end;
  }

  // Tests the next child of a cell; whether it is to be divided too.
  bool enter_child(int slot) {
    OpenCell& cell = descent_.cells[slot];
    const int c = cell.next++;
    const PlaneView p = descent_.with_room_for(cell);
    const Index end = keep_undecided(p, cell.begin, cell.end, cell.end, step_to_child(slot, c));
    if (end < 0) {
      swap_planes(p, cell.begin, -1 - end);
      return false;
    }
    OpenCell& child = descent_.open_child(slot, c);
    child.end = end;
    return enter(child, slot + 1);
  }

  // Settles a cell where nothing is left to divide; whether there is.
  bool enter(const OpenCell& cell, int slot) {
    const bool is_cube = slot == kCube, is_free = cell.begin == cell.end;
    const int exponent = depth_ - (slot - kCube);
    Content content = Content::everything;
    if (!is_free) {
      if (exponent > 3) return true;
      stop_.poll(64 * (cell.end - cell.begin));
      content = fill(descent_.planes.view(), cell.begin, cell.end, half_edge(depth_), brick_);
    }
    // A cube that is a brick stays one, whatever is in it.
    if (content == Content::everything && (!is_cube || is_free)) {
      found_.n_inside += Index{1} << (3 * exponent);
      if (!count_only_ || is_cube) found_.tiles.add(cell.ijk, exponent);
    } else if (content != Content::nothing) {
      add_leaf(cell.ijk, is_cube);
    }
    return false;
  }

  void add_leaf(const Index* ijk, bool is_cube) {
    for (int x = 0; x < 8; ++x) {
      brick_.possible[x] &= ~brick_.inside[x];
      found_.n_inside += ones(brick_.inside[x]);
      found_.n_boundary += ones(brick_.possible[x]);
    }
    if (!count_only_ || is_cube) found_.leaves.add(ijk, brick_.inside, brick_.possible);
  }

  Descent<OpenCell, true, false> descent_;
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
