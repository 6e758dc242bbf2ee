#include "plane_passes.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "avx2.h"
#include "workers.h"

namespace voxkernel {
namespace {

// Keeps the compiler from computing a maximum step after step where a jump is hardly ever taken.
inline bool is_rare(bool condition) {
#if defined(__GNUC__)
  return __builtin_expect(condition, false);
#else
  return condition;
#endif
}

constexpr Index kLeast = 1 << 15;  // planes that are worth a thread
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// Direction bin of a normal: a face of the cube and a cell of its 8 x 8 grid.
// Neighbours in a mesh look much the same way: the jumps are foreseen, and faster than any way around them.
int bin_of(const double* n) {
  const double ax = std::abs(n[0]), ay = std::abs(n[1]), az = std::abs(n[2]);
  int face;
  double u, v, m;
  if (ax >= ay && ax >= az) {
    face = n[0] > 0 ? 0 : 1;
    u = n[1], v = n[2], m = ax;
  } else if (ay >= az) {
    face = n[1] > 0 ? 2 : 3;
    u = n[0], v = n[2], m = ay;
  } else {
    face = n[2] > 0 ? 4 : 5;
    u = n[0], v = n[1], m = az;
  }
  const int p = static_cast<int>((u / m + 1.0) * 3.9999);
  const int q = static_cast<int>((v / m + 1.0) * 3.9999);
  return (face * 8 + p) * 8 + q;
}

double length(const double* p) { return std::sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]); }

// How far a point is inside some planes, less what that may be wrong by.
struct Margins {
  const double* normals;
  const double* offsets;
  const double* errors;
  double x, y, z, size, slack_error;

  double operator()(Index i) const {
    const double* n = normals + 3 * i;
    const double slack = offsets[i] - (n[0] * x + n[1] * y + n[2] * z);
    return slack - (errors[i] * size + slack_error);
  }
};

// Appends the planes of [first, last) that the point is not certainly inside. The sign of a rounded difference is
// exact.
void list_undecided(const Margins& margins, Index first, Index last, std::vector<Index>& undecided) {
  for (Index i = first; i < last; ++i) {
    if (is_rare(margins(i) <= 0.0)) undecided.push_back(i);
  }
}

#ifdef VOXKERNEL_HAS_AVX2

// The same operations on four planes at a time, so the same results.
VOXKERNEL_AVX2 void list_undecided_avx2(const Margins& margins, Index first, Index last,
                                        std::vector<Index>& undecided) {
  const __m256d x = _mm256_set1_pd(margins.x), y = _mm256_set1_pd(margins.y), z = _mm256_set1_pd(margins.z);
  const __m256d size = _mm256_set1_pd(margins.size), slack_error = _mm256_set1_pd(margins.slack_error);
  for (; first + 4 <= last; first += 4) {
    const double* n = margins.normals + 3 * first;
    const Columns normals = columns_of_four(n);
    const __m256d along = _mm256_add_pd(_mm256_add_pd(_mm256_mul_pd(normals.x, x), _mm256_mul_pd(normals.y, y)),
                                        _mm256_mul_pd(normals.z, z));
    const __m256d slack = _mm256_sub_pd(_mm256_loadu_pd(margins.offsets + first), along);
    const __m256d error = _mm256_add_pd(_mm256_mul_pd(_mm256_loadu_pd(margins.errors + first), size), slack_error);
    const __m256d margin = _mm256_sub_pd(slack, error);
    const int listed = _mm256_movemask_pd(_mm256_cmp_pd(margin, _mm256_setzero_pd(), _CMP_LE_OQ));
    if (!is_rare(listed != 0)) continue;
    for (int k = 0; k < 4; ++k) {
      if ((listed >> k & 1) != 0) undecided.push_back(first + k);
    }
  }
  list_undecided(margins, first, last, undecided);
}

#endif

// Calls `visit(i)` for every i < n; asks to stop between blocks only, as counting every step would take longer than a
// plane does.
template <typename Visit>
void each_plane(Index n, Stop& stop, Visit&& visit) {
  constexpr Index block = 1024;
  for (Index first = 0; first < n; first += block) {
    const Index last = std::min(n, first + block);
    stop.poll(last - first);
    for (Index i = first; i < last; ++i) visit(i);
  }
}

// What a stretch of planes says, the first of equal ones.
struct PartTightest {
  Tightest least{kInfinity, kInfinity, -1};
  std::vector<Index> ids = std::vector<Index>(kBins, -1);
  std::vector<double> slacks = std::vector<double>(kBins, kInfinity);
};

}  // namespace

// One pass: the smallest slack d - n . x, the least certain one, and the tightest plane of each direction bin.
// Planes with slack >= limit are left out of the bins. `ids` is -1 where a bin is empty.
Tightest tightest_by_direction(Points normals, Doubles offsets, Doubles errors, const double* point, double limit,
                               Span<Index> ids, Span<double> slacks, int threads, Stop& stop) {
  const Index n = offsets.size();
  const double x = point[0], y = point[1], z = point[2], size = length(point) + 1.0;
  const int n_parts = worth_threads(n, kLeast, threads);
  std::vector<PartTightest> parts(n_parts);
  run_parts(n_parts, stop, [&](int part, Stop& own) {
    const Index begin = part_begin(n, n_parts, part);
    Index* part_ids = parts[part].ids.data();
    double* part_slacks = parts[part].slacks.data();
    double smallest = kInfinity, certain = kInfinity;
    Index where = -1;
    each_plane(part_begin(n, n_parts, part + 1) - begin, own, [&](Index k) {
      const Index i = begin + k;
      const double* m = normals[i];
      const double slack = offsets[i] - (m[0] * x + m[1] * y + m[2] * z);
      const double safe = slack - errors[i] * size;
      if (safe < certain) certain = safe;
      if (is_rare(slack < smallest)) {
        smallest = slack;
        where = i;
      }
      if (slack < limit) {
        const int b = bin_of(m);
        if (slack < part_slacks[b]) {
          part_slacks[b] = slack;
          part_ids[b] = i;
        }
      }
    });
    parts[part].least = {smallest, certain, where};
  });
  Tightest found = parts[0].least;
  std::copy(parts[0].ids.begin(), parts[0].ids.end(), ids.begin());
  std::copy(parts[0].slacks.begin(), parts[0].slacks.end(), slacks.begin());
  for (int part = 1; part < n_parts; ++part) {
    const PartTightest& other = parts[part];
    found.certain = std::min(found.certain, other.least.certain);
    if (other.least.smallest < found.smallest) {
      found.smallest = other.least.smallest;
      found.where = other.least.where;
    }
    for (int b = 0; b < kBins; ++b) {
      if (other.slacks[b] < slacks[b]) {
        slacks[b] = other.slacks[b];
        ids[b] = other.ids[b];
      }
    }
  }
  return found;
}

// One pass: lists the planes whose sign at a point is not certainly negative (inside).
// `slack_error` is a bound on the distance between `point` and the exact point meant.
std::vector<Index> plane_signs(Points normals, Doubles offsets, Doubles errors, const double* point, double slack_error,
                               Stop& stop) {
  const Margins margins{normals.data(), offsets.data(), errors.data(),       point[0],
                        point[1],       point[2],       length(point) + 1.0, slack_error};
  constexpr Index block = 4096;
  std::vector<Index> undecided;
  for (Index first = 0; first < offsets.size(); first += block) {
    const Index last = std::min(first + block, offsets.size());
    stop.poll(last - first);
#ifdef VOXKERNEL_HAS_AVX2
    if (has_avx2) {
      list_undecided_avx2(margins, first, last, undecided);
      continue;
    }
#endif
    list_undecided(margins, first, last, undecided);
  }
  return undecided;
}

}  // namespace voxkernel
