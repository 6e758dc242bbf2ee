#include "linear_program.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "avx2.h"

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

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr Index kStalled = 12;

struct Vector4 {
  double at[4];
};
struct Matrix4 {
  double at[4][4];
};

// Solves a 4 x 4 system in place by elimination with row pivoting; false when singular.
bool solve(Matrix4& matrix, Vector4& right) {
  auto& m = matrix.at;
  auto& r = right.at;
  for (int k = 0; k < 4; ++k) {
    int pivot = k;
    for (int i = k + 1; i < 4; ++i) {
      if (std::abs(m[i][k]) > std::abs(m[pivot][k])) pivot = i;
    }
    if (std::abs(m[pivot][k]) < 1e-14) return false;
    if (pivot != k) {
      for (int j = k; j < 4; ++j) std::swap(m[k][j], m[pivot][j]);
      std::swap(r[k], r[pivot]);
    }
    for (int i = k + 1; i < 4; ++i) {
      const double f = m[i][k] / m[k][k];
      if (f == 0.0) continue;
      for (int j = k + 1; j < 4; ++j) m[i][j] -= f * m[k][j];
      r[i] -= f * r[k];
    }
  }
  for (int k = 3; k >= 0; --k) {
    for (int j = k + 1; j < 4; ++j) r[k] -= m[k][j] * r[j];
    r[k] /= m[k][k];
  }
  return true;
}

// The linear program: maximise t with n . x + t <= d over the working set, |x|_inf <= box, t <= 2 box.
struct Program {
  Points normals;
  Doubles offsets;
  Indices rows;
  double box;

  double cap() const { return 2.0 * box; }

  // Constraint `index` as (n, tau), and its right-hand side.
  double row(Index index, double (&out)[4]) const {
    std::fill_n(out, 4, 0.0);
    if (index < 6) {
      out[index >> 1] = (index & 1) != 0 ? 1.0 : -1.0;
      return box;
    }
    out[3] = 1.0;
    if (index == 6) return cap();
    const Index i = rows[index - 7];
    std::copy_n(normals[i], 3, out);
    return offsets[i];
  }

  // Four constraints as the rows of a matrix, and their right-hand sides.
  Vector4 constraints(Span<const Index> basis, Matrix4& matrix) const {
    Vector4 right;
    for (int j = 0; j < 4; ++j) right.at[j] = row(basis[j], matrix.at[j]);
    return right;
  }

  // The multipliers that combine four constraints to `target`.
  bool combine(Span<const Index> basis, Vector4& target) const {
    Matrix4 rows_of_basis, columns;
    constraints(basis, rows_of_basis);
    for (int j = 0; j < 4; ++j) {
      for (int k = 0; k < 4; ++k) columns.at[k][j] = rows_of_basis.at[j][k];
    }
    return solve(columns, target);
  }

  // The constraint violated most, beyond `worst`; the first one will do when `any` is set. -1 where there is none.
  Index most_violated(const double* point, double worst, bool any) const {
    Index entering = -1;
    const auto look_at = [&](double violation, Index index) {
      if (violation > worst) {
        worst = violation;
        entering = index;
      }
    };
    for (int k = 0; k < 3; ++k) {
      look_at(point[k] - box, 2 * k + 1);
      look_at(-point[k] - box, 2 * k);
    }
    look_at(point[3] - cap(), 6);
    const double x = point[0], y = point[1], z = point[2], t = point[3];
    for (Index w = 0; w < rows.size(); ++w) {
      const Index i = rows[w];
      const double* n = normals[i];
      const double violation = n[0] * x + n[1] * y + n[2] * z + t - offsets[i];
      if (is_rare(violation > worst)) {
        worst = violation;
        entering = 7 + w;
        if (any) break;
      }
    }
    return entering;
  }
};

constexpr Vector4 kObjective{{0.0, 0.0, 0.0, 1.0}};

// The member of the basis whose multiplier vanishes first as the entering one grows; lowest numbers first.
int leaving_member(Span<const Index> basis, Span<const double> multipliers, const Vector4& direction) {
  int leaving = -1;
  double ratio = kInfinity;
  for (int j = 0; j < 4; ++j) {
    if (!(direction.at[j] > 1e-11)) continue;
    const double quotient = multipliers[j] > 1e-13 ? multipliers[j] / direction.at[j] : 0.0;
    if (quotient < ratio || (quotient == ratio && leaving >= 0 && basis[j] < basis[leaving])) {
      ratio = quotient;
      leaving = j;
    }
  }
  return leaving;
}

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

}  // namespace

// `basis` holds four constraint numbers and is used as the start when it is dual feasible; otherwise the start is the
// corner of the box. Fills basis, multipliers and point = (x, t). Returns the number of steps, negative when the steps
// ran out or a basis was singular.
Index deepest_point(Points normals, Doubles offsets, Indices rows, double box, Span<Index> basis,
                    Span<double> multipliers, Span<double> point, double tolerance, Index max_steps, Stop& stop) {
  const Program program{normals, offsets, rows, box};
  Vector4 start = kObjective;
  if (!program.combine(basis, start) || std::any_of(start.at, start.at + 4, [](double m) { return m < 0.0; })) {
    for (int j = 0; j < 3; ++j) basis[j] = 2 * j + 1;
    basis[3] = 6;
  }
  Index stalled = 0;
  double lowest = kInfinity;
  for (Index step = 0; step < max_steps; ++step) {
    stop.poll(rows.size() + 8);
    Vector4 combination = kObjective;
    if (!program.combine(basis, combination)) return -1 - step;
    for (int j = 0; j < 4; ++j) multipliers[j] = std::max(combination.at[j], 0.0);
    Matrix4 matrix;
    Vector4 solution = program.constraints(basis, matrix);
    if (!solve(matrix, solution)) return -1 - step;
    std::copy_n(solution.at, 4, point.data());
    // Parallel faces leave multipliers zero and t as it is: the lowest numbers first (Bland) cannot cycle.
    stalled = point[3] < lowest ? 0 : stalled + 1;
    lowest = std::min(lowest, point[3]);
    const Index entering = program.most_violated(point.data(), tolerance, stalled > kStalled);
    if (entering < 0) return step;
    Vector4 direction;
    program.row(entering, direction.at);
    if (!program.combine(basis, direction)) return -1 - step;
    const int leaving = leaving_member(basis, multipliers, direction);
    if (leaving < 0) return -1 - step;
    basis[leaving] = entering;
  }
  return -1 - max_steps;
}

// One pass: the smallest slack d - n . x, the least certain one, and the tightest plane of each direction bin.
// Planes with slack >= limit are left out of the bins. `ids` is -1 where a bin is empty.
Tightest tightest_by_direction(Points normals, Doubles offsets, Doubles errors, const double* point, double limit,
                               Span<Index> ids, Span<double> slacks, Stop& stop) {
  std::fill(ids.begin(), ids.end(), -1);
  std::fill(slacks.begin(), slacks.end(), kInfinity);
  const double x = point[0], y = point[1], z = point[2], size = length(point) + 1.0;
  double smallest = kInfinity, certain = kInfinity;
  Index where = -1;
  each_plane(offsets.size(), stop, [&](Index i) {
    const double* n = normals[i];
    const double slack = offsets[i] - (n[0] * x + n[1] * y + n[2] * z);
    const double safe = slack - errors[i] * size;
    if (safe < certain) certain = safe;
    if (is_rare(slack < smallest)) {
      smallest = slack;
      where = i;
    }
    if (slack < limit) {
      const int b = bin_of(n);
      if (slack < slacks[b]) {
        slacks[b] = slack;
        ids[b] = i;
      }
    }
  });
  return {smallest, certain, where};
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
