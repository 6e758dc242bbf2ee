#include "star_hull.h"

#include <algorithm>
#include <cmath>

#include "avx2.h"
#include "octahedron.h"

namespace voxkernel {
namespace {

constexpr std::size_t kAtOnce = 64;
constexpr double kBeyond = 1e-12;  // points nearer to a plane count as behind it

double determinant(const double* u, const double* v, const double* w) {
  return u[0] * (v[1] * w[2] - v[2] * w[1]) + u[1] * (v[2] * w[0] - v[0] * w[2]) + u[2] * (v[0] * w[1] - v[1] * w[0]);
}

// How many of some points are beyond the plane n . q = limit.
VOXKERNEL_ALWAYS_INLINE std::int64_t count_beyond(const double* x, const double* y, const double* z, std::size_t size,
                                                  const double* n, double limit) {
  const double nx = n[0], ny = n[1], nz = n[2];
  std::int64_t count = 0;
  for (std::size_t p = 0; p < size; ++p) count += nx * x[p] + ny * y[p] + nz * z[p] > limit ? 1 : 0;
  return count;
}

std::int64_t count_plain(const double* x, const double* y, const double* z, std::size_t size, const double* n,
                         double limit) {
  return count_beyond(x, y, z, size, n, limit);
}

#ifdef VOXKERNEL_HAS_AVX2
VOXKERNEL_AVX2 std::int64_t count_wide(const double* x, const double* y, const double* z, std::size_t size,
                                       const double* n, double limit) {
  return count_beyond(x, y, z, size, n, limit);
}
const auto count_fast = has_avx2 ? count_wide : count_plain;
#else
const auto count_fast = count_plain;
#endif

}  // namespace

void StarHull::clear() {
  for (std::vector<double>* column : {&x_, &y_, &z_}) column->assign(6, 0.0);
  std::vector<double>* const columns[3] = {&x_, &y_, &z_};
  for (int side = 0; side < 6; ++side) (*columns[side / 2])[side] = side % 2 == 0 ? 0.5 : -0.5;
}

void StarHull::push(double x, double y, double z) {
  x_.push_back(x);
  y_.push_back(y);
  z_.push_back(z);
}

// The sides of the cube: an octahedron about the origin.
void StarHull::begin() {
  const std::size_t n = x_.size();
  triangles_.assign(8, Triangle{});
  marks_.assign(8, 0);
  for (std::vector<double>* column : {&nx_, &ny_, &nz_}) column->assign(8, 0.0);
  free_.clear();
  slots_.assign(n, -1);
  stamps_.assign(n, 0);
  stamp_ = 0;
  for (std::int32_t t = 0; t < 8; ++t) place(t, kOctahedron[t][0], kOctahedron[t][1], kOctahedron[t][2]);
  link_octahedron(triangles_.data());
}

// False where the triangle does not certainly turn about the origin.
bool StarHull::place(std::int32_t at, std::int32_t a, std::int32_t b, std::int32_t c) {
  triangles_[at].corner[0] = a;
  triangles_[at].corner[1] = b;
  triangles_[at].corner[2] = c;
  const double u[3] = {x_[a], y_[a], z_[a]};
  const double v[3] = {x_[b] - u[0], y_[b] - u[1], z_[b] - u[2]}, w[3] = {x_[c] - u[0], y_[c] - u[1], z_[c] - u[2]};
  const double n[3] = {v[1] * w[2] - v[2] * w[1], v[2] * w[0] - v[0] * w[2], v[0] * w[1] - v[1] * w[0]};
  const double d = n[0] * u[0] + n[1] * u[1] + n[2] * u[2];
  nx_[at] = n[0] / d;
  ny_[at] = n[1] / d;
  nz_[at] = n[2] / d;
  return d > 0.0;
}

// All triangles that the point is beyond make way for those from it to their border, which has to be one ring.
bool StarHull::insert(std::int32_t point) {
  const double x = x_[point], y = y_[point], z = z_[point];
  const std::size_t n = triangles_.size();
  const double q[3] = {x, y, z};
  const auto is_beyond = [&](std::size_t t) { return x * nx_[t] + y * ny_[t] + z * nz_[t] > 1.0 + kBeyond; };
  std::size_t first = 0;
  while (first < n &&
         count_fast(&nx_[first], &ny_[first], &nz_[first], std::min(kAtOnce, n - first), q, 1.0 + kBeyond) == 0) {
    first += kAtOnce;
  }
  if (first >= n) return true;
  while (!is_beyond(first)) ++first;
  ++stamp_;
  seen_.assign(1, static_cast<std::int32_t>(first));
  marks_[first] = stamp_;
  for (std::size_t i = 0; i < seen_.size(); ++i) {
    for (const std::int32_t other : triangles_[seen_[i]].across) {
      if (marks_[other] == stamp_ || !is_beyond(static_cast<std::size_t>(other))) continue;
      marks_[other] = stamp_;
      seen_.push_back(other);
    }
  }
  horizon_.clear();
  for (const std::int32_t current : seen_) {
    const Triangle& t = triangles_[current];
    for (int k = 0; k < 3; ++k) {
      const std::int32_t outside = t.across[k];
      if (marks_[outside] == stamp_) continue;
      std::int32_t back = 0;
      while (triangles_[outside].across[back] != current) ++back;
      horizon_.push_back({t.corner[(k + 1) % 3], t.corner[(k + 2) % 3], outside, back});
    }
  }
  if (horizon_.size() < 3) return false;
  fresh_.clear();
  bool is_good = true;
  for (const Edge& edge : horizon_) {
    std::int32_t at;
    if (!seen_.empty()) {
      at = seen_.back();
      seen_.pop_back();
    } else if (!free_.empty()) {
      at = free_.back();
      free_.pop_back();
    } else {
      at = static_cast<std::int32_t>(triangles_.size());
      triangles_.push_back({});
      marks_.push_back(0);
      for (std::vector<double>* column : {&nx_, &ny_, &nz_}) column->push_back(0.0);
    }
    is_good = place(at, edge.from, edge.to, point) && is_good && stamps_[edge.from] != stamp_;
    triangles_[at].across[2] = edge.outside;
    triangles_[edge.outside].across[edge.back] = at;
    slots_[edge.from] = at;
    stamps_[edge.from] = stamp_;
    fresh_.push_back(at);
  }
  for (const std::int32_t gone : seen_) {
    nx_[gone] = ny_[gone] = nz_[gone] = 0.0;
    free_.push_back(gone);
  }
  for (std::size_t i = 0; i < horizon_.size(); ++i) {
    const std::int32_t to = horizon_[i].to;
    if (stamps_[to] != stamp_) return false;
    triangles_[fresh_[i]].across[0] = slots_[to];
    triangles_[slots_[to]].across[1] = fresh_[i];
  }
  std::size_t length = 1;
  for (std::int32_t at = triangles_[fresh_[0]].across[0]; at != fresh_[0]; at = triangles_[at].across[0]) {
    if (++length > fresh_.size()) return false;
  }
  return is_good && length == fresh_.size();
}

// Every ray from the origin meets a triangle, as they close about it, all turned outwards. If no point is farther than
// `share` e beyond any of their planes, these bound a body D with D <= hull <= (1 + e) D, and the corners n of the
// triangles span one that is as near to the body looked for.
bool StarHull::is_right(double share) const {
  for (std::size_t t = 0; t < triangles_.size(); ++t) {
    const double n[3] = {nx_[t], ny_[t], nz_[t]};
    if (n[0] == 0.0 && n[1] == 0.0 && n[2] == 0.0) continue;
    for (const std::int32_t c : triangles_[t].corner) {
      if (c < 6 || !(n[0] * x_[c] + n[1] * y_[c] + n[2] * z_[c] >= 1.0 - share)) return false;
    }
    if (count_fast(x_.data(), y_.data(), z_.data(), x_.size(), n, 1.0 + share) != 0) return false;
  }
  return true;
}

// Cones from the origin over the faces, each cut at the foot of the origin in its plane; an edge of the body runs
// between the corners of two triangles, and has a face on either side.
double StarHull::volume() const {
  double sum = 0.0;
  for (std::size_t t = 0; t < triangles_.size(); ++t) {
    const double here[3] = {nx_[t], ny_[t], nz_[t]};
    if (here[0] == 0.0 && here[1] == 0.0 && here[2] == 0.0) continue;
    for (int k = 0; k < 3; ++k) {
      const std::int32_t other = triangles_[t].across[k];
      const double there[3] = {nx_[other], ny_[other], nz_[other]};
      const std::int32_t c = triangles_[t].corner[(k + 1) % 3];
      const double square = x_[c] * x_[c] + y_[c] * y_[c] + z_[c] * z_[c];
      const double foot[3] = {x_[c] / square, y_[c] / square, z_[c] / square};
      sum += determinant(foot, there, here);
    }
  }
  return sum / 6.0;
}

bool StarHull::measure(double share, double* volume, double* box) {
  begin();
  // The nearest planes first: most of the others are then behind what is there.
  const std::int32_t n = static_cast<std::int32_t>(x_.size());
  std::vector<std::pair<double, std::int32_t>>& order = order_;
  order.clear();
  for (std::int32_t p = 6; p < n; ++p) order.push_back({-(x_[p] * x_[p] + y_[p] * y_[p] + z_[p] * z_[p]), p});
  std::sort(order.begin(), order.end());
  for (const auto& entry : order) {
    if (!insert(entry.second)) return false;
  }
  if (!is_right(share)) return false;
  *volume = this->volume();
  std::fill_n(box, 6, 0.0);
  for (std::size_t t = 0; t < triangles_.size(); ++t) {
    const double corner[3] = {nx_[t], ny_[t], nz_[t]};
    for (int a = 0; a < 3; ++a) {
      box[a] = std::min(box[a], corner[a]);
      box[3 + a] = std::max(box[3 + a], corner[a]);
    }
  }
  return true;
}

}  // namespace voxkernel
