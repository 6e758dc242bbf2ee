#include "deepest_point.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace voxkernel {
namespace {

constexpr Index kStalled = 12;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// A 4 x 4 matrix in triangles, by elimination with row pivoting; one elimination serves several right-hand sides.
class Factors {
 public:
  double m[4][4];

  // False when singular.
  bool factor() {
    for (int k = 0; k < 4; ++k) {
      int pivot = k;
      for (int i = k + 1; i < 4; ++i) {
        if (std::abs(m[i][k]) > std::abs(m[pivot][k])) pivot = i;
      }
      if (std::abs(m[pivot][k]) < 1e-14) return false;
      pivot_[k] = pivot;
      if (pivot != k) {
        for (int j = k; j < 4; ++j) std::swap(m[k][j], m[pivot][j]);
      }
      for (int i = k + 1; i < 4; ++i) {
        const double f = m[i][k] == 0.0 ? 0.0 : m[i][k] / m[k][k];
        factor_[k][i] = f;
        if (f == 0.0) continue;
        for (int j = k + 1; j < 4; ++j) m[i][j] -= f * m[k][j];
      }
    }
    return true;
  }
  // In place.
  void solve(double* right) const {
    for (int k = 0; k < 4; ++k) {
      if (pivot_[k] != k) std::swap(right[k], right[pivot_[k]]);
      for (int i = k + 1; i < 4; ++i) {
        if (factor_[k][i] != 0.0) right[i] -= factor_[k][i] * right[k];
      }
    }
    for (int k = 3; k >= 0; --k) {
      for (int j = k + 1; j < 4; ++j) right[k] -= m[k][j] * right[j];
      right[k] /= m[k][k];
    }
  }

 private:
  int pivot_[4];
  double factor_[4][4];
};

}  // namespace

// Writes a constraint as (n, tau) and returns its right-hand side.
double DeepestPoint::row(Index constraint, double* out) const {
  std::fill_n(out, 4, 0.0);
  if (constraint < 6) {
    out[constraint >> 1] = constraint & 1 ? 1.0 : -1.0;
    return box_;
  }
  out[3] = 1.0;
  if (constraint == 6) return 2.0 * box_;
  const Index i = constraint - kFirst;
  out[0] = planes_->x[i];
  out[1] = planes_->y[i];
  out[2] = planes_->z[i];
  return planes_->offset[i];
}

// The constraint that the point violates most, or the first half-space that it violates; -1 where there is none.
Index DeepestPoint::entering(double tolerance, bool first_will_do) const {
  double worst = tolerance;
  Index found = -1;
  const auto consider = [&](double violation, Index constraint) {
    if (violation > worst) {
      worst = violation;
      found = constraint;
    }
  };
  for (Index k = 0; k < 3; ++k) {
    consider(point[k] - box_, 2 * k + 1);
    consider(-point[k] - box_, 2 * k);
  }
  consider(point[3] - 2.0 * box_, 6);
  const double px = point[0], py = point[1], pz = point[2], t = point[3];
  const double *x = planes_->x.data(), *y = planes_->y.data(), *z = planes_->z.data(), *d = planes_->offset.data();
  constexpr Index kBlock = 16;  // hardly any has a half-space that is violated more
  double violations[kBlock];
  for (Index first = 0; first < planes_->size; first += kBlock) {
    const Index n = std::min(kBlock, planes_->size - first);
    const auto violation = [=](Index i) { return x[i] * px + y[i] * py + z[i] * pz + t - d[i]; };
    if (n == kBlock) {
      Index n_worse = 0;
      for (Index k = 0; k < kBlock; ++k) violations[k] = violation(first + k);
      for (Index k = 0; k < kBlock; ++k) n_worse += violations[k] > worst ? 1 : 0;
      if (n_worse == 0) continue;
    } else {
      for (Index k = 0; k < n; ++k) violations[k] = violation(first + k);
    }
    for (Index k = 0; k < n; ++k) {
      if (violations[k] > worst) {
        worst = violations[k];
        found = kFirst + first + k;
        if (first_will_do) return found;
      }
    }
  }
  return found;
}

// Whether the multipliers that combine the constraints of the basis to t are not negative.
bool DeepestPoint::is_dual_feasible() const {
  Factors across;
  for (int j = 0; j < 4; ++j) {
    double constraint[4];
    row(basis[j], constraint);
    for (int k = 0; k < 4; ++k) across.m[k][j] = constraint[k];
  }
  double right[4] = {0.0, 0.0, 0.0, 1.0};
  if (!across.factor()) return false;
  across.solve(right);
  return std::none_of(right, right + 4, [](double m) { return m < 0.0; });
}

// The member of the basis whose multiplier vanishes first as the entering one grows; lowest numbers first.
int DeepestPoint::leaving(const double* direction) const {
  int found = -1;
  double ratio = kInfinity;
  for (int j = 0; j < 4; ++j) {
    if (!(direction[j] > 1e-11)) continue;
    const double quotient = multipliers[j] > 1e-13 ? multipliers[j] / direction[j] : 0.0;
    if (quotient < ratio || (quotient == ratio && found >= 0 && basis[j] < basis[found])) {
      ratio = quotient;
      found = j;
    }
  }
  return found;
}

Index DeepestPoint::find(const HalfSpaceColumns& planes, double box, double tolerance, Index max_steps, Stop& stop) {
  planes_ = &planes;
  box_ = box;
  if (basis != kCorner && !is_dual_feasible()) basis = kCorner;
  Index stalled = 0;
  double lowest = kInfinity;
  for (Index step = 0; step < max_steps; ++step) {
    stop.poll(100 + planes.size);
    Factors across, along;  // the constraints of the basis as columns and as rows
    double solution[4];
    for (int j = 0; j < 4; ++j) {
      solution[j] = row(basis[j], along.m[j]);
      for (int k = 0; k < 4; ++k) across.m[k][j] = along.m[j][k];
    }
    if (!across.factor()) return -1 - step;
    double right[4] = {0.0, 0.0, 0.0, 1.0};
    across.solve(right);
    for (int j = 0; j < 4; ++j) multipliers[j] = std::max(right[j], 0.0);
    if (!along.factor()) return -1 - step;
    along.solve(solution);
    std::copy_n(solution, 4, point.begin());
    // Parallel faces leave multipliers zero and t as it is: the lowest numbers first (Bland) cannot cycle.
    stalled = point[3] < lowest ? 0 : stalled + 1;
    lowest = std::min(lowest, point[3]);
    const Index next = entering(tolerance, stalled > kStalled);
    if (next < 0) return step;
    row(next, right);
    across.solve(right);
    const int gone = leaving(right);
    if (gone < 0) return -1 - step;
    basis[gone] = next;
  }
  return -1 - max_steps;
}

Index deepest_point(Points normals, Doubles offsets, Indices rows, double box, Span<Index> basis,
                    Span<double> multipliers, Span<double> point, double tolerance, Index max_steps, Stop& stop) {
  HalfSpaceColumns planes(rows.size());
  for (const Index i : rows) planes.push(normals[i], offsets[i], 0.0);
  DeepestPoint deepest;
  std::copy_n(basis.data(), 4, deepest.basis.begin());
  std::copy_n(multipliers.data(), 4, deepest.multipliers.begin());
  std::copy_n(point.data(), 4, deepest.point.begin());
  const Index steps = deepest.find(planes, box, tolerance, max_steps, stop);
  std::copy_n(deepest.basis.begin(), 4, basis.data());
  std::copy_n(deepest.multipliers.begin(), 4, multipliers.data());
  std::copy_n(deepest.point.begin(), 4, point.data());
  return steps;
}

}  // namespace voxkernel
