#include "star_hull.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "avx2.h"
#include "octahedron.h"

namespace voxkernel {
namespace {

constexpr double kBeyond = 1e-12;  // points nearer to a plane count as behind it
constexpr double kOnHull = 1e-10;  // points nearer to the hull may be left out where they do not fit
constexpr double kTurned = 1e-14;  // triangles with less volume, for the farthest point, may turn the other way
constexpr double kOtherOrder = 0.01;
constexpr std::int32_t kSides = 6;
constexpr std::size_t kFew = 192;  // so many triangles are looked at one by one
constexpr std::size_t kAtOnce = 64;
constexpr int kMostSteps = 200;  // of a walk over triangles
constexpr std::int32_t kNext[5] = {0, 1, 2, 0, 1};

template <typename P>
VOXKERNEL_ALWAYS_INLINE double dot(const P& u, const P& v) {
  return u.x * v.x + u.y * v.y + u.z * v.z;
}
template <typename P>
VOXKERNEL_ALWAYS_INLINE P cross(const P& u, const P& v) {
  return {u.y * v.z - u.z * v.y, u.z * v.x - u.x * v.z, u.x * v.y - u.y * v.x};
}
template <typename P>
VOXKERNEL_ALWAYS_INLINE P minus(const P& u, const P& v) {
  return {u.x - v.x, u.y - v.y, u.z - v.z};
}

// How many of some planes n . q = limit a point is beyond.
VOXKERNEL_ALWAYS_INLINE std::int64_t count_beyond(const double* nx, const double* ny, const double* nz,
                                                  std::size_t size, const double* q, double limit) {
  const double x = q[0], y = q[1], z = q[2];
  std::int64_t count = 0;
  for (std::size_t t = 0; t < size; ++t) count += x * nx[t] + y * ny[t] + z * nz[t] > limit ? 1 : 0;
  return count;
}

std::int64_t count_plain(const double* nx, const double* ny, const double* nz, std::size_t size, const double* q,
                         double limit) {
  return count_beyond(nx, ny, nz, size, q, limit);
}

#ifdef VOXKERNEL_HAS_AVX2
VOXKERNEL_AVX2 std::int64_t count_wide(const double* nx, const double* ny, const double* nz, std::size_t size,
                                       const double* q, double limit) {
  return count_beyond(nx, ny, nz, size, q, limit);
}
const auto count_fast = has_avx2 ? count_wide : count_plain;
#else
const auto count_fast = count_plain;
#endif

}  // namespace

void StarHull::clear() {
  points_.assign(kSides, Point{0.0, 0.0, 0.0});
  for (int side = 0; side < kSides; ++side) {
    Point& p = points_[side];
    (side < 2 ? p.x : side < 4 ? p.y : p.z) = side % 2 == 0 ? 0.5 : -0.5;
  }
}

void StarHull::push(double x, double y, double z) { points_.push_back({x, y, z}); }

// The sides of the cube: an octahedron about the origin.
void StarHull::begin() {
  triangles_.resize(8);
  free_.clear();
  slots_.assign(points_.size(), -1);
  stamps_.assign(points_.size(), 0);
  stamp_ = last_ = 0;
  is_turned_ = true;
  least_ = kTurned * farthest_ * std::sqrt(farthest_);
  for (std::int32_t t = 0; t < 8; ++t) {
    Triangle& triangle = triangles_[t];
    triangle.mark = 0;
    std::copy_n(kOctahedron[t], 3, triangle.corner);
    plane_of(points_[triangle.corner[0]], points_[triangle.corner[1]], points_[triangle.corner[2]], &triangle.n);
  }
  link_octahedron(triangles_.data());
  for (std::vector<double>* column : {&nx_, &ny_, &nz_}) column->clear();
  for (const Triangle& t : triangles_) {
    nx_.push_back(t.n.x);
    ny_.push_back(t.n.y);
    nz_.push_back(t.n.z);
  }
}

// The nearest planes first: most of the others are then behind what is there. Their squares as floats tell enough;
// positive ones are in the order of their bits.
void StarHull::sort_by_distance(double spread) {
  order_.clear();
  farthest_ = 0.25;
  for (std::int32_t p = kSides; p < static_cast<std::int32_t>(points_.size()); ++p) {
    const double square = dot(points_[p], points_[p]);
    farthest_ = std::max(farthest_, square);
    const float rounded = static_cast<float>(square * (1.0 + spread * (p % 8)));
    std::uint32_t bits;
    std::memcpy(&bits, &rounded, sizeof bits);
    order_.push_back(static_cast<std::uint64_t>(~bits) << 32 | static_cast<std::uint32_t>(p));
  }
  std::sort(order_.begin(), order_.end());
}

// False where the triangle does not turn about the origin.
bool StarHull::plane_of(const Point& a, const Point& b, const Point& c, Point* n) {
  const Point u = cross(minus(b, a), minus(c, a));
  const double d = dot(u, a);
  if (!(d > 0.0)) return false;
  if (!(d > least_)) is_turned_ = false;
  const double share = 1.0 / d;
  *n = {u.x * share, u.y * share, u.z * share};
  return true;
}

// A triangle that is likely to be close: where the point was before, or one of those near it.
std::int32_t StarHull::hint_for(std::int32_t point, const Nearby& nearby) const {
  const auto is_there = [&](std::int32_t slot) { return slot >= 0 && triangles_[slot].corner[0] >= 0; };
  if (is_there(slots_[point])) return slots_[point];
  if (point < kSides || nearby.empty()) return last_;
  for (const std::int32_t other : nearby[point - kSides]) {
    if (is_there(slots_[kSides + other])) return slots_[kSides + other];
  }
  return last_;
}

// The first of few triangles that the point is beyond; -1 where there is none.
std::int32_t StarHull::first_beyond(const Point& q, double limit) const {
  const std::size_t n = triangles_.size();
  const double at[3] = {q.x, q.y, q.z};
  for (std::size_t first = 0; first < n; first += kAtOnce) {
    if (count_fast(&nx_[first], &ny_[first], &nz_[first], std::min(kAtOnce, n - first), at, limit) == 0) continue;
    while (!(dot(q, triangles_[first].n) > limit)) ++first;
    return static_cast<std::int32_t>(first);
  }
  return -1;
}

// Climbs, over triangles that the point is ever farther beyond, to one that it is certainly beyond: mostly the first,
// or close to it. Else gives the one over which the point is, to which it then walks; -1 where rounding leads it in
// circles.
std::int32_t StarHull::seed_for(const Point& q, std::int32_t hint) const {
  std::int32_t at = hint;
  double here = dot(q, triangles_[at].n);
  while (!(here > 1.0 + kBeyond)) {
    const std::int32_t* across = triangles_[at].across;
    const double a = dot(q, triangles_[across[0]].n), b = dot(q, triangles_[across[1]].n);
    const double c = dot(q, triangles_[across[2]].n), best = std::max(a, std::max(b, c));
    if (!(best > here)) return locate(q, at);
    at = best == a ? across[0] : best == b ? across[1] : across[2];
    here = best;
  }
  return at;
}

std::int32_t StarHull::locate(const Point& q, std::int32_t hint) const {
  std::int32_t at = hint;
  for (int step = 0; step < kMostSteps; ++step) {
    const Triangle& t = triangles_[at];
    const Point &a = points_[t.corner[0]], &b = points_[t.corner[1]], &c = points_[t.corner[2]];
    const double sides[3] = {dot(q, cross(b, c)), dot(q, cross(c, a)), dot(q, cross(a, b))};
    const int k = sides[0] < sides[1] ? (sides[0] < sides[2] ? 0 : 2) : (sides[1] < sides[2] ? 1 : 2);
    if (!(sides[k] < 0.0)) return at;
    at = t.across[k];
  }
  return -1;
}

// All triangles that the point is beyond, and their border: false where that is not one ring.
bool StarHull::trace(std::int32_t seed, const Point& q) {
  ++stamp_;
  const std::size_t most = 3 * triangles_.size() + 3;
  if (open_.size() < most) {
    open_.resize(most);
    horizon_.resize(most);
    seen_.resize(most);
  }
  Edge* const open = open_.data();
  Triangle* const triangles = triangles_.data();
  std::int32_t n_open = 0, n_seen = 0, n_border = 0;
  const auto put = [&](std::int32_t current, int k) {
    const Triangle& t = triangles[current];
    open[n_open++] = {t.corner[kNext[k + 1]], t.corner[kNext[k + 2]], t.across[k], current};
  };
  seen_[n_seen++] = seed;
  triangles[seed].mark = stamp_;
  for (int k = 2; k >= 0; --k) put(seed, k);
  while (n_open > 0) {
    Edge edge = open[--n_open];
    Triangle& t = triangles[edge.outside];
    if (t.mark == stamp_) continue;
    edge.back = t.across[0] == edge.back ? 0 : t.across[1] == edge.back ? 1 : 2;
    const double beyond = dot(q, t.n) - 1.0;
    if (beyond > kBeyond) {
      excess_ = std::max(excess_, beyond);
      t.mark = stamp_;
      seen_[n_seen++] = edge.outside;
      put(edge.outside, kNext[edge.back + 2]);
      put(edge.outside, kNext[edge.back + 1]);
    } else {
      horizon_[n_border++] = edge;
    }
  }
  n_seen_ = n_seen;
  n_border_ = n_border;
  if (n_border < 3) return false;
  std::int32_t before = horizon_[n_border - 1].to;
  bool is_ring = true;
  for (std::int32_t i = 0; i < n_border; ++i) {
    const Edge& edge = horizon_[i];
    is_ring = is_ring && edge.from == before && stamps_[edge.from] != stamp_;
    stamps_[edge.from] = stamp_;
    before = edge.to;
  }
  return is_ring;
}

void StarHull::clear_triangle(std::int32_t at) {
  triangles_[at].n = {0.0, 0.0, 0.0};
  triangles_[at].corner[0] = -1;
  nx_[at] = ny_[at] = nz_[at] = 0.0;
}

// All triangles that the point is beyond make way for those from it to their border.
bool StarHull::insert(std::int32_t point, std::int32_t hint) {
  const Point q = points_[point];
  const bool is_small = triangles_.size() <= kFew;
  const std::int32_t seed = is_small ? first_beyond(q, 1.0 + kBeyond) : seed_for(q, hint);
  if (seed < 0) return is_small;
  last_ = seed;
  excess_ = dot(q, triangles_[seed].n) - 1.0;
  if (!(excess_ > kBeyond)) {
    slots_[point] = seed;
    return true;
  }
  bool is_good = trace(seed, q);
  const std::int32_t n = n_border_;
  if (static_cast<std::int32_t>(planes_.size()) < n) {
    planes_.resize(2 * n);
  }
  for (std::int32_t i = 0; is_good && i < n; ++i) {
    is_good = plane_of(points_[horizon_[i].from], points_[horizon_[i].to], q, &planes_[i]);
  }
  if (!is_good) return excess_ < kOnHull;
  for (; n_seen_ < n; ++n_seen_) {
    if (free_.empty()) {
      free_.push_back(static_cast<std::int32_t>(triangles_.size()));
      triangles_.push_back({});
      for (std::vector<double>* column : {&nx_, &ny_, &nz_}) column->push_back(0.0);
    }
    seen_[n_seen_] = free_.back();
    free_.pop_back();
  }
  const std::int32_t* const fresh = seen_.data();
  for (std::int32_t i = 0; i < n; ++i) {
    const Edge& edge = horizon_[i];
    const std::int32_t at = fresh[i];
    triangles_[at] = {planes_[i],
                      {edge.from, edge.to, point},
                      {fresh[i + 1 < n ? i + 1 : 0], fresh[i > 0 ? i - 1 : n - 1], edge.outside},
                      0};
    nx_[at] = planes_[i].x;
    ny_[at] = planes_[i].y;
    nz_[at] = planes_[i].z;
    triangles_[edge.outside].across[edge.back] = at;
    slots_[edge.from] = at;
  }
  slots_[point] = last_ = fresh[0];
  for (std::int32_t i = n; i < n_seen_; ++i) {
    clear_triangle(seen_[i]);
    free_.push_back(seen_[i]);
  }
  return true;
}

// Each edge once, with the triangle on its left in `back`.
void StarHull::list_edges() {
  edges_.resize(3 * triangles_.size() + 1);
  std::size_t n = 0;
  for (std::int32_t i = 0; i < static_cast<std::int32_t>(triangles_.size()); ++i) {
    const Triangle& t = triangles_[i];
    if (t.corner[0] < 0) continue;
    for (int k = 0; k < 3; ++k) {
      edges_[n] = {t.corner[kNext[k + 1]], t.corner[kNext[k + 2]], t.across[k], i};
      n += t.across[k] > i ? 1 : 0;
    }
  }
  edges_.resize(n);
}

// Every ray from the origin meets a triangle, as they close about it, all turned outwards. If no point is farther than
// `share` e beyond any of their planes, these bound a body D with D <= hull <= (1 + e) D, and the corners n of the
// triangles span one that is as near to the body looked for.
bool StarHull::is_right(double share, const Nearby& nearby) {
  rests_.resize(triangles_.size());
  for (std::size_t i = 0; i < triangles_.size(); ++i) {
    const Triangle& t = triangles_[i];
    if (t.corner[0] < 0) continue;
    double rest = 0.0;
    for (const std::int32_t c : t.corner) {
      const double off = dot(t.n, points_[c]) - 1.0;
      if (c < kSides || !(off >= -share)) return false;
      rest = std::max(rest, std::abs(off));
    }
    rests_[i] = rest;
  }
  return (triangles_.size() > kFew && is_convex(share, nearby)) || has_none_beyond(share);
}

// Whether a triangle has this corner; `slots_` then names one, as every change about a corner renews its entry.
bool StarHull::is_corner(std::int32_t point) const {
  if (slots_[point] < 0) return false;
  const std::int32_t* corner = triangles_[slots_[point]].corner;
  return corner[0] >= 0 && (corner[0] == point || corner[1] == point || corner[2] == point);
}

// Whether that follows from the edges alone. Let q be in the cone over triangle t', and a way lead straight from
// triangle t to q. Where it goes from one triangle with plane n to the next with n' over the edge from a to b, n' - n
// is s m, with the unit normal m of the plane of a, b and the origin, and a rest: as both planes are off a and b by r
// at most, it changes the value at q by r |q| (|a| + |b|) / |a x b| or less. As q is on the far side of that plane, n'
// . q
// - n . q >= min(s, 0) |q| - rest. A way crosses an edge once, so that n . q of t exceeds n' . q of t' by no more than
// the sum over all edges; and that of t' is looked up for every point that is no corner.
bool StarHull::is_convex(double share, const Nearby& nearby) const {
  if (!is_turned_) return false;
  const double reach = std::sqrt(farthest_);
  double sum = 0.0, worst = 0.0;
  for (const Edge& edge : edges_) {
    const Triangle &t = triangles_[edge.back], &other = triangles_[edge.outside];
    const Point m = cross(points_[edge.from], points_[edge.to]);  // the first triangle is on the side it points to
    const double bend = dot(minus(other.n, t.n), m);              // > 0 where the edge is hollow
    const double rest = std::max(rests_[edge.back], rests_[edge.outside]);
    sum += (std::max(bend, 0.0) + 4.0 * reach * (rest + 4e-16 * reach)) / std::sqrt(dot(m, m));
  }
  if (!(sum * reach < 0.5 * share)) return false;
  for (std::int32_t p = 0; p < static_cast<std::int32_t>(points_.size()); ++p) {
    if (is_corner(p)) continue;
    const std::int32_t t = locate(points_[p], hint_for(p, nearby));
    if (t < 0) return false;
    worst = std::max(worst, dot(points_[p], triangles_[t].n));
  }
  return worst < 1.0 + 0.5 * share;
}

// Whether no point is more than `share` beyond any triangle.
bool StarHull::has_none_beyond(double share) const {
  return std::all_of(points_.begin(), points_.end(), [&](const Point& p) { return first_beyond(p, 1.0 + share) < 0; });
}

// Cones from the origin over the faces, each cut at the foot of the origin in its plane; an edge of the body runs
// between the corners n of two triangles, and has a face on either side.
double StarHull::volume() {
  double sum = 0.0;
  feet_.clear();
  for (const Point& q : points_) {
    const double share = 1.0 / dot(q, q);
    feet_.push_back({q.x * share, q.y * share, q.z * share});
  }
  for (const Edge& edge : edges_) {
    const Point between = cross(triangles_[edge.outside].n, triangles_[edge.back].n);
    sum += dot(minus(feet_[edge.from], feet_[edge.to]), between);
  }
  return sum / 6.0;
}

bool StarHull::make(double spread, double share, const Nearby& nearby) {
  sort_by_distance(spread);
  begin();
  for (const std::uint64_t entry : order_) {
    const std::int32_t p = static_cast<std::int32_t>(entry & 0xffffffffu);
    if (!insert(p, hint_for(p, nearby))) return false;
  }
  list_edges();
  return is_right(share, nearby);
}

// Points that are nearly in one plane make thin triangles, which another order may not: there is a second try.
bool StarHull::measure(double share, const Nearby& nearby, double* volume, double* box) {
  if (!make(0.0, share, nearby) && !make(kOtherOrder, share, nearby)) return false;
  *volume = this->volume();
  std::fill_n(box, 6, 0.0);
  for (const Triangle& t : triangles_) {
    if (t.corner[0] < 0) continue;
    const double corner[3] = {t.n.x, t.n.y, t.n.z};
    for (int a = 0; a < 3; ++a) {
      box[a] = std::min(box[a], corner[a]);
      box[3 + a] = std::max(box[3 + a], corner[a]);
    }
  }
  return true;
}

}  // namespace voxkernel
