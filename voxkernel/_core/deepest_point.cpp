#include "deepest_point.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace voxkernel {
namespace {

constexpr int kStalled = 12;

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
Index DeepestPoint::entering(double tolerance, bool first_will_do) {
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
  double* violations = violations_.data();
  for (Index i = 0; i < planes_->size; ++i) violations[i] = x[i] * px + y[i] * py + z[i] * pz + t - d[i];
  for (Index i = 0; i < planes_->size; ++i) {
    if (violations[i] > worst) {
      worst = violations[i];
      found = kFirst + i;
      if (first_will_do) break;
    }
  }
  return found;
}

bool DeepestPoint::find(const HalfSpaceColumns& planes, double box, double tolerance, int max_steps, Stop& stop) {
  planes_ = &planes;
  box_ = box;
  basis = {1, 3, 5, 6};
  int stalled = 0;
  double lowest = std::numeric_limits<double>::infinity();
  for (int step = 0; step < max_steps; ++step) {
    stop.poll(100 + planes.size);
    Factors across, along;  // the constraints of the basis as columns and as rows
    double solution[4];
    for (int j = 0; j < 4; ++j) {
      solution[j] = row(basis[j], along.m[j]);
      for (int k = 0; k < 4; ++k) across.m[k][j] = along.m[j][k];
    }
    if (!across.factor() || !along.factor()) return false;
    double right[4] = {0.0, 0.0, 0.0, 1.0};
    across.solve(right);
    for (int j = 0; j < 4; ++j) multipliers[j] = std::max(right[j], 0.0);
    along.solve(solution);
    std::copy_n(solution, 4, point.begin());
    // Parallel faces leave multipliers zero and t as it is: the lowest numbers first (Bland) cannot cycle.
    stalled = point[3] < lowest ? 0 : stalled + 1;
    lowest = std::min(lowest, point[3]);
    const Index next = entering(tolerance, stalled > kStalled);
    if (next < 0) return true;
    row(next, right);
    across.solve(right);
    int leaving = -1;
    double ratio = std::numeric_limits<double>::infinity();
    for (int j = 0; j < 4; ++j) {
      if (!(right[j] > 1e-11)) continue;
      const double quotient = multipliers[j] > 1e-13 ? multipliers[j] / right[j] : 0.0;
      if (quotient < ratio || (quotient == ratio && leaving >= 0 && basis[j] < basis[leaving])) {
        ratio = quotient;
        leaving = j;
      }
    }
    if (leaving < 0) return false;
    basis[leaving] = next;
  }
  return false;
}

}  // namespace voxkernel
