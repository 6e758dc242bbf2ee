#include "sphere_region.h"

#include <algorithm>
#include <limits>

namespace voxkernel {
namespace {

constexpr int kRounds = 200;
constexpr Index kStretch = 1 << 12;  // planes looked at between two polls
constexpr double kFlat = 1e-13;      // pivots below this come from nearly dependent normals

double excess(Points normals, Doubles offsets, Index plane, const double* x) {
  const double* n = normals[plane];
  return n[0] * x[0] + n[1] * x[1] + n[2] * x[2] - offsets[plane];
}

// A point on up to three planes, and the weights of their normals in the way there.
struct Foot {
  Index planes[3];
  unsigned n = 0;
  double multipliers[3];
  double y[3];
};

// Projects z on the planes of a foot; false where their normals are nearly dependent.
bool project(Points normals, Doubles offsets, const double* z, Foot& foot) {
  double gram[3][3], right[3];
  for (unsigned i = 0; i < foot.n; ++i) {
    const double* p = normals[foot.planes[i]];
    right[i] = -offsets[foot.planes[i]];
    for (int k = 0; k < 3; ++k) right[i] += p[k] * z[k];
    for (unsigned j = 0; j < foot.n; ++j) {
      const double* q = normals[foot.planes[j]];
      gram[i][j] = p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
    }
  }
  for (unsigned i = 0; i < foot.n; ++i) {  // elimination without pivots: the Gram matrix is positive definite
    if (gram[i][i] < kFlat) return false;
    for (unsigned j = i + 1; j < foot.n; ++j) {
      const double factor = gram[j][i] / gram[i][i];
      for (unsigned k = i; k < foot.n; ++k) gram[j][k] -= factor * gram[i][k];
      right[j] -= factor * right[i];
    }
  }
  for (unsigned i = foot.n; i-- > 0;) {
    double value = right[i];
    for (unsigned k = i + 1; k < foot.n; ++k) value -= gram[i][k] * foot.multipliers[k];
    foot.multipliers[i] = value / gram[i][i];
  }
  for (int k = 0; k < 3; ++k) {
    foot.y[k] = z[k];
    for (unsigned i = 0; i < foot.n; ++i) foot.y[k] -= foot.multipliers[i] * normals(foot.planes[i], k);
  }
  return true;
}

// The plane a point is outside of most, by more than a tolerance; -1 where there is none.
Index most_violated(Points normals, Doubles offsets, const double* y, double tolerance) {
  double worst = tolerance;
  Index at = -1;
  for (Index i = 0; i < offsets.size(); ++i) {
    const double over = excess(normals, offsets, i, y);
    if (over > worst) worst = over, at = i;
  }
  return at;
}

// Whether a foot is the nearest point of the planes `working`: it is pulled, never pushed, and inside them all.
bool holds(Points normals, Doubles offsets, const Foot& foot, const Index* working, unsigned n, double tolerance) {
  for (unsigned i = 0; i < foot.n; ++i)
    if (!(foot.multipliers[i] >= 0.0)) return false;
  for (unsigned i = 0; i < n; ++i)
    if (!(excess(normals, offsets, working[i], foot.y) <= tolerance)) return false;
  return true;
}

}  // namespace

// Finds the point of a polytope nearest to z; false where rounding forbids it.
//
// At most three planes hold the answer. The most violated plane joins them, the best subset that
// contains it stays: the distance grows with every round, so no subset comes twice.
bool nearest_point(Points normals, Doubles offsets, const double* z, double tolerance, double* y, Stop& stop) {
  Index working[3] = {-1, -1, -1};
  unsigned n = 0;
  std::copy_n(z, 3, y);
  for (int round = 0; round < kRounds; ++round) {
    stop.poll(offsets.size());
    const Index at = most_violated(normals, offsets, y, tolerance);
    if (at < 0) return true;
    for (unsigned i = 0; i < n; ++i) {
      if (working[i] == at) return false;
    }
    Foot best;
    double nearest = std::numeric_limits<double>::infinity();
    for (unsigned mask = 0; mask < 1U << n; ++mask) {
      if (mask == 7) continue;  // four planes
      Foot foot;
      foot.planes[foot.n++] = at;
      for (unsigned i = 0; i < n; ++i)
        if (mask >> i & 1U) foot.planes[foot.n++] = working[i];
      if (!project(normals, offsets, z, foot) || !holds(normals, offsets, foot, working, n, tolerance)) continue;
      const double u = foot.y[0] - z[0], v = foot.y[1] - z[1], w = foot.y[2] - z[2];
      const double distance = u * u + v * v + w * w;
      if (distance < nearest) nearest = distance, best = foot;
    }
    if (best.n == 0) return false;
    n = best.n;
    std::copy_n(best.planes, n, working);
    std::copy_n(best.y, 3, y);
  }
  return false;
}

// Whether a segment has a point in the polytope: clip each with the planes, one after the other.
bool edges_meet(Points starts, Points ends, Points normals, Doubles offsets, Stop& stop) {
  Index work = 0;
  for (Index e = 0; e < starts.size(); ++e) {
    if (work > kStretch) {
      stop.poll(work);
      work = 0;
    }
    const double *a = starts[e], *b = ends[e];
    double enter = 0.0, leave = 1.0;
    Index i = 0;
    for (; i < offsets.size() && !(enter > leave); ++i) {
      double first = offsets[i], last = offsets[i];
      for (int k = 0; k < 3; ++k) {
        first -= normals(i, k) * a[k];
        last -= normals(i, k) * b[k];
      }
      if (first < 0.0 && last < 0.0) {
        leave = -1.0;
      } else if (first < 0.0) {
        enter = std::max(enter, first / (first - last));
      } else if (last < 0.0) {
        leave = std::min(leave, first / (first - last));
      }
    }
    work += 1 + i;
    if (enter <= leave) return true;
  }
  return false;
}

}  // namespace voxkernel
