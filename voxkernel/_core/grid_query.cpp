#include "grid_query.h"

#include <algorithm>

#include "avx2.h"
#include "stretches.h"

namespace voxkernel {
namespace {

constexpr double kFar = 0x1p26;  // beyond every grid, and still exact as an integer

// Whether a voxel is active, without a branch: half of the queries would guess it wrong.
// Unsigned throughout: a voxel far away wraps around before it is found to be outside.
inline bool is_active(const BlockTable& table, Index x, Index y, Index z) {
  const auto block = [&](Index coordinate, int axis) {
    return static_cast<std::uint64_t>(coordinate >> 3) - static_cast<std::uint64_t>(table.low[axis]);
  };
  const auto extent = [&](int axis) { return static_cast<std::uint64_t>(table.shape[axis]); };
  const std::uint64_t bx = block(x, 0), by = block(y, 1), bz = block(z, 2);
  const std::uint64_t is_in =
      std::uint64_t{bx < extent(0)} & std::uint64_t{by < extent(1)} & std::uint64_t{bz < extent(2)};
  const std::uint64_t place = ((bx * extent(1) + by) * extent(2) + bz) * is_in;
  const std::uint64_t word = table.words[Index{table.row[static_cast<Index>(place)]} << 3 | (x & 7)];
  return (word >> ((y & 7) << 3 | (z & 7)) & is_in) != 0;
}

// Voxel coordinate of a float, rounded down; what is out of reach, or NaN, stays out of reach.
VOXKERNEL_ALWAYS_INLINE std::int32_t cell(double value) {
  double near = value < kFar ? value : kFar;
  near = near > -kFar ? near : -kFar;
  const double whole = static_cast<std::int32_t>(near);  // towards zero
  return static_cast<std::int32_t>(whole > near ? whole - 1.0 : whole);
}

// 21 bits with two zero bits between them. Unsigned, since bits are shifted out at the top.
inline Index spread(Index bits) {
  auto value = static_cast<std::uint64_t>(bits);
  value = (value | (value << 32)) & 0x1F00000000FFFF;
  value = (value | (value << 16)) & 0x1F0000FF0000FF;
  value = (value | (value << 8)) & 0x100F00F00F00F00F;
  value = (value | (value << 4)) & 0x10C30C30C30C30C3;
  return static_cast<Index>((value | (value << 2)) & 0x1249249249249249);
}

// The last run that begins at or before a code, 0 where none does; there must be a run.
inline Index run_of(Indices code, Index at) {
  Index first = 0;
  for (Index length = code.size(); length > 1;) {
    const Index half = length >> 1;
    first += code[first + half] <= at ? half : 0;
    length -= half;
  }
  return first;
}

inline bool is_active(const MortonRuns& runs, Index x, Index y, Index z) {
  const auto is_near = [&](Index v) { return -runs.reach <= v && v < runs.reach; };
  if (runs.code.size() == 0 || !is_near(x) || !is_near(y) || !is_near(z)) return false;
  const Index blocks = runs.reach >> 3;
  const Index at = spread((x >> 3) + blocks) << 2 | spread((y >> 3) + blocks) << 1 | spread((z >> 3) + blocks);
  const Index run = run_of(runs.code, at);
  if (at < runs.code[run] || at > runs.last[run]) return false;
  const Index leaf = runs.row[run];
  return leaf < 0 || (runs.masks(leaf, x & 7) >> ((y & 7) << 3 | (z & 7)) & 1) != 0;
}

constexpr Index kStretch = 256;

// One coordinate of the cells of a stretch of points, which compilers turn into wide registers; the sum from left to
// right.
VOXKERNEL_ALWAYS_INLINE void fill_row(const double* __restrict points, Index n, const double* origin,
                                      const double* axis, std::int32_t* __restrict row) {
  const double ku = axis[0], kv = axis[1], kw = axis[2], u = origin[0], v = origin[1], w = origin[2];
  for (Index i = 0; i < n; ++i) {
    row[i] = cell((points[3 * i] - u) * ku + (points[3 * i + 1] - v) * kv + (points[3 * i + 2] - w) * kw);
  }
}

#ifdef VOXKERNEL_HAS_AVX2
// The same operations on four points at a time, so the same results.
VOXKERNEL_AVX2 void fill_avx2(const double* points, Index n, const double* origin, Points to_cells,
                              std::int32_t (&cells)[3][kStretch]) {
  const __m256d far = _mm256_set1_pd(kFar), near = _mm256_set1_pd(-kFar);
  const __m256d u = _mm256_set1_pd(origin[0]), v = _mm256_set1_pd(origin[1]), w = _mm256_set1_pd(origin[2]);
  Index i = 0;
  for (; i + 4 <= n; i += 4) {
    const Columns p = columns_of_four(points + 3 * i);
    const __m256d x = _mm256_sub_pd(p.x, u), y = _mm256_sub_pd(p.y, v), z = _mm256_sub_pd(p.z, w);
    for (int axis = 0; axis < 3; ++axis) {
      const __m256d ku = _mm256_set1_pd(to_cells(axis, 0)), kv = _mm256_set1_pd(to_cells(axis, 1)),
                    kw = _mm256_set1_pd(to_cells(axis, 2));
      const __m256d sum =
          _mm256_add_pd(_mm256_add_pd(_mm256_mul_pd(x, ku), _mm256_mul_pd(y, kv)), _mm256_mul_pd(z, kw));
      const __m256d bounded = _mm256_max_pd(_mm256_min_pd(sum, far), near);  // NaN becomes kFar, as in `cell`
      _mm_storeu_si128(reinterpret_cast<__m128i*>(cells[axis] + i), _mm256_cvttpd_epi32(_mm256_floor_pd(bounded)));
    }
  }
  for (int axis = 0; axis < 3; ++axis) fill_row(points + 3 * i, n - i, origin, to_cells[axis], cells[axis] + i);
}
#endif

void fill(const double* points, Index n, const double* origin, Points to_cells, std::int32_t (&cells)[3][kStretch]) {
#ifdef VOXKERNEL_HAS_AVX2
  if (has_avx2) return fill_avx2(points, n, origin, to_cells, cells);
#endif
  for (int axis = 0; axis < 3; ++axis) fill_row(points, n, origin, to_cells[axis], cells[axis]);
}

// First the cells of a stretch of points, then the look-ups.
template <typename Grid>
void points_in(Points points, const double* origin, Points to_cells, const Grid& grid, Span<bool> active, Stop& stop) {
  std::int32_t cells[3][kStretch];
  const Grid own = grid;  // whose address nobody has: it stays in registers
  for (Index first = 0; first < points.size(); first += kStretch) {
    const Index n = std::min(kStretch, points.size() - first);
    stop.poll(16 * n);
    fill(points[first], n, origin, to_cells, cells);
    for (Index i = 0; i < n; ++i) active[first + i] = is_active(own, cells[0][i], cells[1][i], cells[2][i]);
  }
}

template <typename Voxel, typename Grid>
void voxels_in(Rows<const Voxel, 3> voxels, const Grid& grid, Span<bool> active, Stop& stop) {
  const Grid own = grid;
  for_each(voxels.size(), 16, stop, [=](Index i) {
    const Voxel* v = voxels[i];
    active[i] = is_active(own, v[0], v[1], v[2]);
  });
}

}  // namespace

template <typename Voxel>
void voxels_in_table(Rows<const Voxel, 3> voxels, const BlockTable& table, Span<bool> active, Stop& stop) {
  voxels_in(voxels, table, active, stop);
}

template <typename Voxel>
void voxels_in_runs(Rows<const Voxel, 3> voxels, const MortonRuns& runs, Span<bool> active, Stop& stop) {
  voxels_in(voxels, runs, active, stop);
}

template void voxels_in_table(Rows<const std::int32_t, 3>, const BlockTable&, Span<bool>, Stop&);
template void voxels_in_table(Rows<const std::int64_t, 3>, const BlockTable&, Span<bool>, Stop&);
template void voxels_in_runs(Rows<const std::int32_t, 3>, const MortonRuns&, Span<bool>, Stop&);
template void voxels_in_runs(Rows<const std::int64_t, 3>, const MortonRuns&, Span<bool>, Stop&);

void points_in_table(Points points, const double* origin, Points to_cells, const BlockTable& table, Span<bool> active,
                     Stop& stop) {
  points_in(points, origin, to_cells, table, active, stop);
}

void points_in_runs(Points points, const double* origin, Points to_cells, const MortonRuns& runs, Span<bool> active,
                    Stop& stop) {
  points_in(points, origin, to_cells, runs, active, stop);
}

}  // namespace voxkernel
