#include "cell_kernel.h"

#include <algorithm>
#include <cmath>

#include "predicates.h"

namespace voxkernel {
namespace {

constexpr double kUnitRoundoff = 0x1p-53;
// A square of this half edge about the foot of the centre holds every face of a kernel in the unit ball.
constexpr double kSquare = 2.5;
constexpr double kFar = 0x1p23;

}  // namespace

// By signs of cofactors. The cofactors m of the true unit normals satisfy sum(m n) = 0 exactly; all of one sign and
// sum(m d) < 0 make them a witness (Farkas). Every sign is taken with a bound on its error: a plane's
// normal and offset are each off by at most its `error`.
bool proves_empty(const HalfSpaceColumns& planes, const Index* ids) {
  const auto &x = planes.x, &y = planes.y, &z = planes.z;
  double total = 0.0, doubt = 0.0;
  int n_positive = 0;
  for (int skip = 0; skip < 4; ++skip) {
    const Index a = ids[skip == 0 ? 1 : 0], b = ids[skip <= 1 ? 2 : 1], c = ids[skip <= 2 ? 3 : 2];
    double value =
        x[a] * (y[b] * z[c] - y[c] * z[b]) + y[a] * (z[b] * x[c] - z[c] * x[b]) + z[a] * (x[b] * y[c] - x[c] * y[b]);
    if (skip & 1) value = -value;
    const double error = 1.1 * (planes.error[a] + planes.error[b] + planes.error[c]) + 32.0 * kUnitRoundoff;
    if (std::abs(value) <= error) return false;
    if (value > 0.0) ++n_positive;
    const double d = planes.offset[ids[skip]], e = planes.error[ids[skip]];
    total += value * d;
    doubt += error * (std::abs(d) + e) + std::abs(value) * (e + 8.0 * kUnitRoundoff * std::abs(d));
  }
  if (n_positive == 0) {
    total = -total;
  } else if (n_positive < 4) {
    return false;
  }
  return total < -doubt;
}

// For x in the kernel the multipliers l >= 0, sum 1, give 0 >= sum(l (n . x - d)) = r . x - sum(l d) with a small r:
// not for |x| <= kFar where -sum(l d) is larger than |r| kFar and the errors. A kernel point at |x| > kFar is on the
// inner side of every facet, so that n . u <= 1 / kFar + error for u = x / |x|. On a closed surface the sum of A (n .
// u) is zero, so that of A |n . u| is at most 2 (1 / kFar + error) times the area; and it is at least the volume, by
// the divergence theorem on z = x . u, |z| <= 1. A volume far above that excludes such points.
bool proves_empty_near(const HalfSpaceColumns& planes, double volume, double area, const DeepestPoint& deepest) {
  double largest = 0.0;
  for (Index i = 0; i < planes.size; ++i) largest = std::max(largest, planes.error[i]);
  if (largest > 0.1 / kFar || volume < 100.0 / kFar * area || volume < 100.0 / kFar) return false;
  const auto& basis = deepest.basis;
  double total = 0.0;
  for (int k = 0; k < 4; ++k) {
    if (basis[k] >= DeepestPoint::kFirst) total += deepest.multipliers[k];
  }
  if (!(total > 0.5)) return false;
  double rx = 0.0, ry = 0.0, rz = 0.0, right = 0.0, error = 0.0;
  for (int k = 0; k < 4; ++k) {
    if (basis[k] < DeepestPoint::kFirst) continue;
    const Index i = basis[k] - DeepestPoint::kFirst;
    const double share = deepest.multipliers[k] / total;
    rx += share * planes.x[i];
    ry += share * planes.y[i];
    rz += share * planes.z[i];
    right += share * planes.offset[i];
    error += share * planes.error[i];
  }
  const double rest = std::sqrt(rx * rx + ry * ry + rz * rz) + 16.0 * kUnitRoundoff;
  return -right > (rest + error) * (kFar + 1.0) + 32.0 * kUnitRoundoff;
}

// The corners of a facet count as on its plane. What floating point cannot tell is decided exactly.
Convexity ConvexityTest::test(const Cell& cell, Points local, const PolygonPlanes& polygons,
                              const HalfSpaceColumns& planes, Stop& stop) {
  const Index n = cell.n_vertices;
  const Points raw = cell.points();
  for (Index v = 0; v < n; ++v) {
    x_[v] = local(v, 0);
    y_[v] = local(v, 1);
    z_[v] = local(v, 2);
    own_[v] = -1;
  }
  const double *x = x_.data(), *y = y_.data(), *z = z_.data();
  double* values = values_.data();
  Convexity answer{0.0, true};
  for (Index p = 0; p < planes.size; ++p) {
    stop.poll(n);
    const Index f = polygons.face[p];
    const Index* corners = polygons.corners.data() + 3 * p;
    if (polygons.is_planar[f]) {
      for (Index k = cell.start[f]; k < cell.start[f + 1]; ++k) own_[cell.ring[k]] = p;
    } else {
      for (int k = 0; k < 3; ++k) own_[corners[k]] = p;
    }
    const double nx = planes.x[p], ny = planes.y[p], nz = planes.z[p], d = planes.offset[p];
    const double error = 2.0 * planes.error[p];
    for (Index v = 0; v < n; ++v) values[v] = nx * x[v] + ny * y[v] + nz * z[v] - d;
    for (Index v = 0; v < n; ++v) {
      const double value = values[v];
      if (value < -error) continue;
      answer.excess = std::max(answer.excess, value + error);
      if (!answer.is_convex || own_[v] == p) continue;
      answer.is_convex =
          !(value > error) && !(orientation(raw[corners[0]], raw[corners[1]], raw[corners[2]], raw[v]) > 0.0);
    }
  }
  return answer;
}

FaceCutter::FaceCutter(Index most)
    : order_(most),
      slack_(most),
      x_(most),
      y_(most),
      z_(most),
      alike_(most),
      p_(most),
      q_(most),
      square_(most),
      right_(most),
      right_square_(most),
      shared_(most * most) {}

void FaceCutter::Polygon::reserve(Index n) {
  if (static_cast<Index>(label.size()) >= n) return;
  x.resize(n);
  y.resize(n);
  label.resize(n);
}

// Nearest planes first: they cut the most away.
void FaceCutter::sort_by_slack(const HalfSpaceColumns& planes, const double* center) {
  n_ = planes.size;
  for (Index i = 0; i < n_; ++i) {
    const double slack = planes.slack(i, center);
    Index k = i;
    for (; k > 0 && slack_[k - 1] > slack; --k) {
      slack_[k] = slack_[k - 1];
      order_[k] = order_[k - 1];
    }
    slack_[k] = slack;
    order_[k] = i;
  }
  for (Index k = 0; k < n_; ++k) {
    x_[k] = planes.x[order_[k]];
    y_[k] = planes.y[order_[k]];
    z_[k] = planes.z[order_[k]];
  }
}

// All planes as half-planes p x + q y <= right of plane i, in an orthonormal frame of it (Duff et al. 2017).
void FaceCutter::project(Index i) {
  const double nx = x_[i], ny = y_[i], nz = z_[i], own = slack_[i];
  const double sign = nz >= 0.0 ? 1.0 : -1.0;
  const double a = -1.0 / (sign + nz), b = nx * ny * a;
  const double ux = 1.0 + sign * nx * nx * a, uy = sign * b, uz = -sign * nx;
  const double vx = b, vy = sign + ny * ny * a, vz = -ny;
  const double frame[2][3] = {{ux, uy, uz}, {vx, vy, vz}};
  std::copy(&frame[0][0], &frame[0][0] + 6, &frame_[0][0]);
  const double *x = x_.data(), *y = y_.data(), *z = z_.data(), *slack = slack_.data();
  double *alike = alike_.data(), *p = p_.data(), *q = q_.data();
  double *square = square_.data(), *right = right_.data(), *right_square = right_square_.data();
  const Index n = n_;
  for (Index j = 0; j < n; ++j) {
    alike[j] = nx * x[j] + ny * y[j] + nz * z[j];
    p[j] = x[j] * ux + y[j] * uy + z[j] * uz;
    q[j] = x[j] * vx + y[j] * vy + z[j] * vz;
  }
  for (Index j = 0; j < n; ++j) {
    square[j] = p[j] * p[j] + q[j] * q[j];
    right[j] = slack[j] - own * alike[j];
    right_square[j] = right[j] > 0.0 ? right[j] * right[j] : -1.0;
  }
}

// How many corners of the polygon are beyond plane j; by how much is in `values_`, which of the first 64 in `beyond_`.
Index FaceCutter::side_of_corners(Index j) {
  const Index n = polygon_.size;
  if (static_cast<Index>(values_.size()) < n) values_.resize(2 * n);
  const double p = p_[j], q = q_[j], right = right_[j];
  const double *x = polygon_.x.data(), *y = polygon_.y.data();
  double* values = values_.data();
  Index outside = 0;
  std::uint64_t beyond = 0;
  for (Index k = 0; k < n; ++k) {
    values[k] = p * x[k] + q * y[k] - right;
    const std::uint64_t is_beyond = values[k] > 0.0 ? 1 : 0;
    outside += static_cast<Index>(is_beyond);
    beyond |= is_beyond << (k & 63);
  }
  beyond_ = beyond;
  return outside;
}

// Puts the corner of the edge from a corner to the next on plane j behind those of `next_`.
void FaceCutter::push_crossing(Index from, Index to, Index name) {
  const double t = values_[from] / (values_[from] - values_[to]);
  next_.push(polygon_.x[from] + t * (polygon_.x[to] - polygon_.x[from]),
             polygon_.y[from] + t * (polygon_.y[to] - polygon_.y[from]), name);
}

void FaceCutter::push_corners(Index first, Index last) {
  const Index at = next_.size - first;
  for (Index k = first; k < last; ++k) {
    next_.x[at + k] = polygon_.x[k];
    next_.y[at + k] = polygon_.y[k];
    next_.label[at + k] = polygon_.label[k];
  }
  next_.size += last - first;
}

// Leaves what is behind plane j. A cut adds one corner to a convex polygon; a polygon that rounding has bent may be
// cut more than once, but never to more than twice its corners.
void FaceCutter::cut_polygon(Index j, Index outside) {
  const Index n = polygon_.size;
  next_.reserve(2 * n);
  next_.size = 0;
  // Corners beyond are one run: the new edge runs along plane j where it begins, the old one goes on where it ends.
  const std::uint64_t before = beyond_ << 1 | (beyond_ >> (n - 1) & 1);
  const std::uint64_t starts = beyond_ & ~before;
  if (n < 64 && (starts & (starts - 1)) == 0) {
    Index first = 0;
    while ((starts >> first & 1) == 0) ++first;
    const Index last = first + outside, ends = last < n ? last : last - n;
    const Index inner = first == 0 ? n - 1 : first - 1, outer = ends == 0 ? n - 1 : ends - 1;
    if (last < n) {
      push_corners(0, first);
      push_crossing(inner, first, j);
      push_crossing(outer, ends, polygon_.label[outer]);
      push_corners(ends, n);
    } else {
      push_crossing(outer, ends, polygon_.label[outer]);
      push_corners(ends, first);
      push_crossing(inner, first, j);
    }
  } else {
    Index last = n - 1;
    for (Index k = 0; k < n; last = k++) {
      const bool is_beyond = values_[k] > 0.0;
      if (is_beyond != (values_[last] > 0.0)) push_crossing(last, k, is_beyond ? j : polygon_.label[last]);
      if (!is_beyond) push_corners(k, k + 1);
    }
  }
  std::swap(polygon_, next_);
  reach_ = 0.0;
  for (Index k = 0; k < polygon_.size; ++k) {
    reach_ = std::max(reach_, polygon_.x[k] * polygon_.x[k] + polygon_.y[k] * polygon_.y[k]);
  }
}

// Cuts the polygon of plane i out of a square; false where nothing is left.
bool FaceCutter::cut_face(Index i, double same) {
  project(i);
  polygon_.reserve(4);
  polygon_.size = 0;
  polygon_.push(kSquare, kSquare, -1);
  polygon_.push(-kSquare, kSquare, -1);
  polygon_.push(-kSquare, -kSquare, -1);
  polygon_.push(kSquare, -kSquare, -1);
  reach_ = 2.0 * kSquare * kSquare;
  const double *square = square_.data(), *right_square = right_square_.data();
  for (Index j = 0; j < n_; ++j) {
    if (j == i) continue;
    if (square[j] < same * same && alike_[j] > 0.0) {
      const double gap = slack_[j] - slack_[i];
      if (gap < -same || (gap <= same && j < i)) return false;
      continue;
    }
    if (right_square[j] > reach_ * square[j]) continue;
    const Index outside = side_of_corners(j);
    if (outside == 0) continue;
    if (outside == polygon_.size) return false;
    cut_polygon(j, outside);
    if (polygon_.size < 3) return false;
  }
  return true;
}

// Takes the corners of the polygon, which is in plane i, into a box.
void FaceCutter::widen(Index i, double* box) const {
  const double normal[3] = {x_[i], y_[i], z_[i]};
  for (Index k = 0; k < polygon_.size; ++k) {
    for (int axis = 0; axis < 3; ++axis) {
      const double at = slack_[i] * normal[axis] + polygon_.x[k] * frame_[0][axis] + polygon_.y[k] * frame_[1][axis];
      box[axis] = std::min(box[axis], at);
      box[3 + axis] = std::max(box[3 + axis], at);
    }
  }
}

// Every face is cut out of its own plane by all others. Two faces that meet list their common edge
// each by itself: the sum of the differences of these lengths says whether the faces close. Planes
// that differ by less than `same` are one.
FaceCutter::Solid FaceCutter::cut(const HalfSpaceColumns& planes, const double* center, double same, double* box) {
  if (box != nullptr) std::fill_n(box, 6, 0.0);  // the centre is inside
  sort_by_slack(planes, center);
  std::fill_n(shared_.begin(), n_ * n_, 0.0);
  double volume = 0.0, extent = 0.0;
  for (Index i = 0; i < n_; ++i) {
    if (!cut_face(i, same)) continue;
    extent = std::max(extent, reach_ + slack_[i] * slack_[i]);
    if (box != nullptr) widen(i, box);
    double area = 0.0;
    for (Index k = 0; k < polygon_.size; ++k) {
      const Index after = k + 1 < polygon_.size ? k + 1 : 0;
      const double x = polygon_.x[k], y = polygon_.y[k], next_x = polygon_.x[after], next_y = polygon_.y[after];
      area += x * next_y - next_x * y;
      if (polygon_.label[k] < 0) return {0.0, 0.0, -1.0};
      const double dx = next_x - x, dy = next_y - y;
      shared_[i * n_ + polygon_.label[k]] += std::sqrt(dx * dx + dy * dy);
    }
    volume += 0.5 * area * slack_[i] / 3.0;
  }
  double misfit = 0.0;
  for (Index i = 0; i < n_; ++i) {
    for (Index j = 0; j < i; ++j) misfit += std::abs(shared_[i * n_ + j] - shared_[j * n_ + i]);
  }
  return {volume, std::sqrt(extent), misfit};
}

}  // namespace voxkernel
