// The convex hull of the dual points n / s, s = d - n . centre, by insertion in spatially sorted rounds.
//
// The one question is on which side of plane l the common point of planes i, j, k lies: the sign of the determinant of
// the rows (n, s), which is s_i s_j s_k s_l times the volume spanned by the dual points. Floating point answers where
// the volume is larger than a bound on its error, integers made from the input otherwise. Dual points in the plane of a
// triangle are not beyond it, so that a point beyond the hull sees a disk, whatever is degenerate; planes that touch
// the polytope in a vertex or an edge only are corners of triangles all of which lie in one or two planes, and drop out
// when triangles in one plane are taken together: those are one vertex of the polytope.
#include "dual_hull.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>

#include "common_point.h"

namespace voxkernel {
namespace {

constexpr double kUnit = 0x1p-53;
constexpr double kExactDual = 0x1p-48;   // bound on the relative error of dual points made from integers
constexpr double kGoodDual = 0x1p-44;    // dual points less certain than this are made from integers
constexpr double kUnderflow = 0x1p-600;  // more than what underflow can cost a product of three numbers
constexpr Index kSorted = 64;            // so many points are inserted as they come

struct Dual {
  double q[3];
  double error;  // of each coordinate
};

struct Triangle {
  std::int32_t corner[3];
  std::int32_t across[3];  // the triangle across the edge opposite corner k; its corners k + 1 and k + 2
  std::int32_t mark;
};

double size_of(const double* v) { return std::abs(v[0]) + std::abs(v[1]) + std::abs(v[2]); }

double determinant(const double* u, const double* v, const double* w) {
  return u[0] * (v[1] * w[2] - v[2] * w[1]) + u[1] * (v[2] * w[0] - v[0] * w[2]) + u[2] * (v[0] * w[1] - v[1] * w[0]);
}

// A bound on the error of `determinant` for vectors of 1-norms l whose 1-norms are off by at most e: what moving the
// vectors changes, as |det| <= the product of 1-norms, and its own rounding, less than 8 u of that product.
double determinant_error(const double (&l)[3], const double (&e)[3]) {
  const double wide = (l[0] + e[0]) * (l[1] + e[1]) * (l[2] + e[2]);
  return (wide - l[0] * l[1] * l[2]) * (1.0 + 16.0 * kUnit) + 32.0 * kUnit * wide + kUnderflow;
}

// Bits of a number spread out, so that two of them can be woven into one key.
std::uint64_t spread(std::uint64_t x) {
  x = (x | x << 16) & 0x0000ffff0000ffffu;
  x = (x | x << 8) & 0x00ff00ff00ff00ffu;
  x = (x | x << 4) & 0x0f0f0f0f0f0f0f0fu;
  x = (x | x << 2) & 0x3333333333333333u;
  return (x | x << 1) & 0x5555555555555555u;
}

// A face of the polytope: the first row on its plane, and the dual point.
struct Face {
  Index row;
  std::int32_t point;
};

class DualHull {
 public:
  DualHull(const LocalPlanes& planes, const PlaneSource& source, Indices rows, int cube_exponent, Stop& stop)
      : planes_(planes),
        stop_(stop),
        rows_(sorted(rows)),
        n_(rows.size()),
        exact_(source, rows_, cube_exponent),
        points_(source, rows_) {
    find_duals(cube_exponent);
  }

  HullPolytope run() {
    HullPolytope found;
    found.is_inside = is_inside_;
    if (is_inside_) {
      insert_all();
      read_polytope(found);
    }
    found.n_decided = exact_.n_decided();
    return found;
  }

 private:
  // Rows by direction: the side of a cube, and a cell of it, along a curve that stays near. Neighbours in space are
  // then neighbours in memory.
  std::vector<Index> sorted(Indices rows) {
    if (rows.size() <= kSorted) return {rows.begin(), rows.end()};
    struct Keyed {
      std::uint64_t key;
      Index row;
    };
    std::vector<Keyed> order;
    order.reserve(rows.size());
    for (const Index row : rows) {
      stop_.poll(4);
      const double* n = planes_.normals[row];
      int axis = 0;
      for (int k = 1; k < 3; ++k) {
        if (std::abs(n[k]) > std::abs(n[axis])) axis = k;
      }
      const double inverse = 1.0 / std::abs(n[axis]);
      const auto cell = [&](double value) {
        const double place = (value * inverse + 1.0) * (0.5 * kCells);
        return static_cast<std::uint64_t>(place > 0.0 ? std::min(place, kCells - 1.0) : 0.0);
      };
      const std::uint64_t woven = spread(cell(n[(axis + 1) % 3])) | spread(cell(n[(axis + 2) % 3])) << 1;
      order.push_back({static_cast<std::uint64_t>(axis + (n[axis] > 0.0 ? 0 : 3)) << 40 | woven, row});
    }
    std::sort(order.begin(), order.end(), [&](const Keyed& a, const Keyed& b) {
      stop_.poll();
      return a.key < b.key || (a.key == b.key && a.row < b.row);
    });
    std::vector<Index> found(order.size());
    keys_.resize(order.size());
    for (std::size_t i = 0; i < order.size(); ++i) {
      found[i] = order[i].row;
      keys_[i] = order[i].key;
    }
    return found;
  }

  // |n / s - n* / s*| <= |n / s| (e + 3 u + ds / (s - ds)) with |n - n*| <= e and |s - s*| <= ds, |n| about 1.
  void find_duals(int cube_exponent) {
    duals_.resize(n_ + 6);
    const double* center = planes_.center;
    const double reach = std::sqrt(center[0] * center[0] + center[1] * center[1] + center[2] * center[2]) + 1.0;
    for (Index i = 0; i < n_; ++i) {
      stop_.poll(4);
      const double* n = planes_.normals[rows_[i]];
      const double slack = planes_.offsets[rows_[i]] - (n[0] * center[0] + n[1] * center[1] + n[2] * center[2]);
      const double e = planes_.errors[rows_[i]];
      const double slack_error = (e + 8.0 * kUnit) * reach + planes_.center_error;
      Dual& dual = duals_[i];
      double share = std::numeric_limits<double>::infinity();
      if (slack > 2.0 * slack_error) share = 1.01 * (e + slack_error / (slack - slack_error)) + 4.0 * kUnit;
      if (share <= kGoodDual) {
        for (int k = 0; k < 3; ++k) dual.q[k] = n[k] / slack;
      } else {
        if (exact_.slack_sign(i) <= 0) {
          is_inside_ = false;
          return;
        }
        exact_.dual(i, planes_.scale, dual.q);
        share = kExactDual;
      }
      dual.error = 1.01 * share * size_of(dual.q);
    }
    // Local units: the cube has half edge 2**cube_exponent in units of the world.
    const double far = planes_.scale * std::ldexp(1.0, -std::min(cube_exponent, 1000));
    for (int side = 0; side < 6; ++side) {
      Dual& dual = duals_[n_ + side];
      dual = {{0.0, 0.0, 0.0}, cube_exponent <= 1000 ? 0.0 : far};
      if (cube_exponent <= 1000) dual.q[side / 2] = side % 2 == 0 ? far : -far;
    }
  }

  // 1 if dual point l is beyond the plane of i, j, k, seen from the centre; 0 on it.
  int beyond(Index i, Index j, Index k, Index l) {
    const Dual *a = &duals_[i], *b = &duals_[j], *c = &duals_[k], *d = &duals_[l];
    const double u[3] = {a->q[0] - d->q[0], a->q[1] - d->q[1], a->q[2] - d->q[2]};
    const double v[3] = {b->q[0] - d->q[0], b->q[1] - d->q[1], b->q[2] - d->q[2]};
    const double w[3] = {c->q[0] - d->q[0], c->q[1] - d->q[1], c->q[2] - d->q[2]};
    const double value = determinant(u, v, w);
    const double lengths[3] = {size_of(u), size_of(v), size_of(w)};
    // Each coordinate of a difference is off by the errors of both points, and u of itself.
    const double errors[3] = {3.0 * (a->error + d->error) + kUnit * lengths[0],
                              3.0 * (b->error + d->error) + kUnit * lengths[1],
                              3.0 * (c->error + d->error) + kUnit * lengths[2]};
    const double error = determinant_error(lengths, errors);
    if (value > error) return -1;
    if (value < -error) return 1;
    return -exact_.planes_sign(i, j, k, l);
  }
  int beyond(const Triangle& t, Index l) { return beyond(t.corner[0], t.corner[1], t.corner[2], l); }

  // The sign of the determinant of the dual points, 2 where floating point cannot tell.
  int side(Index i, Index j, Index k) const {
    const Dual *a = &duals_[i], *b = &duals_[j], *c = &duals_[k];
    const double value = determinant(a->q, b->q, c->q);
    const double lengths[3] = {size_of(a->q), size_of(b->q), size_of(c->q)};
    const double errors[3] = {3.0 * a->error, 3.0 * b->error, 3.0 * c->error};
    const double error = determinant_error(lengths, errors);
    return value > error ? 1 : value < -error ? -1 : 2;
  }

  // The dual points of the sides of the cube: an octahedron about the centre.
  void begin() {
    const std::int32_t x = static_cast<std::int32_t>(n_);
    const std::int32_t faces[8][3] = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4},
                                      {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
    triangles_.reserve(static_cast<std::size_t>(2 * std::min<Index>(n_, 1 << 16) + 8));
    for (const auto& f : faces) triangles_.push_back({{x + f[0], x + f[1], x + f[2]}, {-1, -1, -1}, 0});
    for (Triangle& t : triangles_) {
      for (int k = 0; k < 3; ++k) {
        for (std::int32_t other = 0; other < 8; ++other) {
          const Triangle& o = triangles_[other];
          for (int m = 0; m < 3; ++m) {
            if (o.corner[m] == t.corner[(k + 2) % 3] && o.corner[(m + 1) % 3] == t.corner[(k + 1) % 3]) {
              t.across[k] = other;
            }
          }
        }
      }
    }
    slots_.assign(n_ + 6, -1);
  }

  void insert_all() {
    begin();
    first_same_ = rows_;
    if (n_ <= kSorted) {
      for (Index i = 0; i < n_; ++i) insert(i);
      return;
    }
    // Rounds: the tightest plane of every cell, of coarse cells first; the rest in the last one.
    std::vector<char> is_in(n_, 0);
    for (int shift = kFirstShift; shift >= 0; shift -= 2) {
      for (Index i = 0; i < n_;) {
        const std::uint64_t cell = keys_[i] >> shift;
        Index best = i;
        double longest = -1.0;
        for (; i < n_ && keys_[i] >> shift == cell; ++i) {
          const double* q = duals_[i].q;
          const double length = q[0] * q[0] + q[1] * q[1] + q[2] * q[2];
          if (length > longest) {
            longest = length;
            best = i;
          }
        }
        if (is_in[best] == 0) {
          is_in[best] = 1;
          insert(best);
        }
      }
    }
    std::vector<std::uint64_t>().swap(keys_);
    for (Index i = 0; i < n_; ++i) {
      if (is_in[i] == 0) insert(i);
    }
  }

  // The triangle whose cone, closed, holds dual point l; or one that l is beyond.
  std::int32_t locate(Index l, int* where) {
    std::int32_t at = last_;
    for (Index steps = 0;; ++steps) {
      stop_.poll();
      const Triangle& t = triangles_[at];
      random_ ^= random_ << 13;
      random_ ^= random_ >> 17;
      random_ ^= random_ << 5;
      const int first = static_cast<int>(random_ % 3);
      int uncertain = 0, next = -1;
      for (int j = 0; j < 3 && next < 0; ++j) {
        const int k = (first + j) % 3;
        const int sign = side(t.corner[(k + 1) % 3], t.corner[(k + 2) % 3], l);
        if (sign == -1) next = k;
        if (sign == 2) uncertain |= 1 << k;
      }
      if (next < 0) {
        *where = beyond(t, l);
        if (*where > 0 || uncertain == 0) return at;
        for (int k = 0; k < 3 && next < 0; ++k) {
          if ((uncertain >> k & 1) && exact_.normals_sign(t.corner[(k + 1) % 3], t.corner[(k + 2) % 3], l) < 0) {
            next = k;
          }
        }
        if (next < 0) return at;
      }
      at = t.across[next];
      // A walk at random gets there; should it take very long, all triangles are asked.
      if (steps > 1000 + static_cast<Index>(triangles_.size())) return look_everywhere(l, where);
    }
  }

  std::int32_t look_everywhere(Index l, int* where) {
    std::int32_t touched = last_;
    *where = -1;
    for (std::size_t i = 0; i < triangles_.size(); ++i) {
      if (triangles_[i].corner[0] < 0) continue;
      stop_.poll();
      const int found = beyond(triangles_[i], l);
      if (found > *where) {
        *where = found;
        touched = static_cast<std::int32_t>(i);
        if (found > 0) break;
      }
    }
    return touched;
  }

  void insert(Index l) {
    stop_.poll(16);
    int where;
    const std::int32_t at = locate(l, &where);
    last_ = at;
    if (where <= 0) {
      if (where == 0) note_same(triangles_[at], l);
      return;
    }
    // What it sees, by neighbours.
    ++stamp_;
    seen_.clear();
    seen_.push_back(at);
    triangles_[at].mark = stamp_;
    horizon_.clear();
    for (std::size_t i = 0; i < seen_.size(); ++i) {
      const std::int32_t current = seen_[i];
      for (int k = 0; k < 3; ++k) {
        const std::int32_t other = triangles_[current].across[k];
        if (triangles_[other].mark == stamp_) continue;
        if (triangles_[other].mark != -stamp_ && beyond(triangles_[other], l) > 0) {
          triangles_[other].mark = stamp_;
          seen_.push_back(other);
        } else {
          triangles_[other].mark = -stamp_;
        }
      }
    }
    stop_.poll(4 * static_cast<Index>(seen_.size()));
    for (const std::int32_t current : seen_) {
      const Triangle& t = triangles_[current];
      for (int k = 0; k < 3; ++k) {
        if (triangles_[t.across[k]].mark == stamp_) continue;
        int back = 0;
        while (triangles_[t.across[k]].across[back] != current) ++back;
        horizon_.push_back({t.corner[(k + 1) % 3], t.corner[(k + 2) % 3], t.across[k], back});
      }
    }
    // New triangles, from each edge of the horizon to the point, in the places of those that go.
    fresh_.clear();
    for (const Edge& edge : horizon_) {
      std::int32_t place;
      if (!seen_.empty()) {
        place = seen_.back();
        seen_.pop_back();
      } else if (!free_.empty()) {
        place = free_.back();
        free_.pop_back();
      } else {
        place = static_cast<std::int32_t>(triangles_.size());
        triangles_.push_back({});
      }
      triangles_[place] = {{edge.from, edge.to, static_cast<std::int32_t>(l)}, {-1, -1, edge.outside}, 0};
      triangles_[edge.outside].across[edge.back] = place;
      slots_[edge.from] = place;
      fresh_.push_back(place);
    }
    for (const std::int32_t gone : seen_) {
      triangles_[gone].corner[0] = -1;
      free_.push_back(gone);
    }
    for (std::size_t i = 0; i < horizon_.size(); ++i) {
      const std::int32_t next = slots_[horizon_[i].to];
      triangles_[fresh_[i]].across[0] = next;
      triangles_[next].across[1] = fresh_[i];
    }
    last_ = fresh_[0];
  }

  // A point on a triangle may be one of its corners: two half-spaces that are the same.
  void note_same(const Triangle& t, Index l) {
    for (const std::int32_t other : t.corner) {
      if (other >= n_) continue;
      const Dual &a = duals_[other], &b = duals_[l];
      bool is_near = true;
      for (int k = 0; k < 3; ++k) is_near = is_near && std::abs(a.q[k] - b.q[k]) <= 2.0 * (a.error + b.error);
      if (is_near && exact_.are_same(other, l)) {
        first_same_[other] = std::min(first_same_[other], rows_[l]);
        return;
      }
    }
  }

  // Triangles in one plane have one number: a vertex of the polytope.
  std::vector<std::int32_t> vertex_numbers(std::int32_t* count) {
    std::vector<std::int32_t> number(triangles_.size(), -1);
    std::vector<std::int32_t> stack;
    *count = 0;
    for (std::size_t i = 0; i < triangles_.size(); ++i) {
      if (triangles_[i].corner[0] < 0 || number[i] >= 0) continue;
      stop_.poll(4);
      number[i] = *count;
      stack.push_back(static_cast<std::int32_t>(i));
      while (!stack.empty()) {
        const std::int32_t current = stack.back();
        stack.pop_back();
        const Triangle& t = triangles_[current];
        for (int k = 0; k < 3; ++k) {
          const std::int32_t other = t.across[k];
          if (number[other] >= 0) continue;
          const Triangle& o = triangles_[other];
          int opposite = 0;
          while (o.across[opposite] != current) ++opposite;
          if (beyond(t, o.corner[opposite]) == 0) {
            number[other] = *count;
            stack.push_back(other);
          }
        }
      }
      ++*count;
    }
    return number;
  }

  void read_polytope(HullPolytope& found) {
    for (const Triangle& t : triangles_) {
      for (int k = 0; k < 3; ++k) {
        if (t.corner[0] >= 0 && t.corner[k] >= n_) found.is_closed = false;
      }
    }
    if (!found.is_closed) return;
    std::int32_t n_vertices;
    const std::vector<std::int32_t> number = vertex_numbers(&n_vertices);
    // A triangle of every dual point, and the faces in the order of their rows.
    std::vector<std::int32_t>& around = slots_;
    std::fill(around.begin(), around.end(), -1);
    for (std::size_t i = 0; i < triangles_.size(); ++i) {
      if (triangles_[i].corner[0] < 0) continue;
      for (const std::int32_t c : triangles_[i].corner) around[c] = static_cast<std::int32_t>(i);
    }
    std::vector<Face> faces;
    for (Index p = 0; p < n_; ++p) {
      if (around[p] >= 0) faces.push_back({first_same_[p], static_cast<std::int32_t>(p)});
    }
    std::vector<std::int32_t> ring, start{0};
    ring.reserve(static_cast<std::size_t>(3) * n_vertices);
    std::size_t n_faces = 0;
    for (const Face& face : faces) {
      const std::size_t begin = ring.size();
      std::int32_t at = around[face.point];
      do {
        stop_.poll();
        const Triangle& t = triangles_[at];
        int k = 0;
        while (t.corner[k] != face.point) ++k;
        if (ring.size() == begin || ring.back() != number[at]) ring.push_back(number[at]);
        at = t.across[(k + 1) % 3];
      } while (at != around[face.point]);
      while (ring.size() > begin + 1 && ring.back() == ring[begin]) ring.pop_back();
      if (ring.size() < begin + 3) {
        ring.resize(begin);
        continue;
      }
      faces[n_faces++] = face;
      start.push_back(static_cast<std::int32_t>(ring.size()));
    }
    faces.resize(n_faces);
    choose_corners(found, n_vertices, ring, start, faces);
  }

  // Three faces for every vertex, the widest apart; faces in the order of their rows, vertices numbered by their first
  // appearance, polygons turned to the vertex of the lowest rows.
  void choose_corners(HullPolytope& found, std::int32_t n_vertices, const std::vector<std::int32_t>& ring,
                      const std::vector<std::int32_t>& start, const std::vector<Face>& faces) {
    const auto n_faces = static_cast<std::int32_t>(faces.size());
    std::vector<std::int32_t> first(n_vertices + 1, 0), around(ring.size());
    for (const std::int32_t v : ring) ++first[v + 1];
    for (std::int32_t v = 0; v < n_vertices; ++v) first[v + 1] += first[v];
    {
      std::vector<std::int32_t> fill(first.begin(), first.end() - 1);
      for (std::int32_t f = 0; f < n_faces; ++f) {
        for (std::int32_t j = start[f]; j < start[f + 1]; ++j) around[fill[ring[j]]++] = f;
      }
    }
    std::vector<std::array<Index, 3>> three(n_vertices);
    std::vector<double> points(static_cast<std::size_t>(3) * n_vertices);
    for (std::int32_t v = 0; v < n_vertices; ++v) {
      stop_.poll(4);
      std::int32_t* low = around.data() + first[v];
      const std::int32_t n = first[v + 1] - first[v];
      std::sort(low, low + n, [&](std::int32_t a, std::int32_t b) { return faces[a].row < faces[b].row; });
      const std::array<std::int32_t, 3> chosen = widest(low, n, faces);
      for (int k = 0; k < 3; ++k) three[v][k] = faces[chosen[k]].row;
      const double error =
          common_point(faces[chosen[0]].point, faces[chosen[1]].point, faces[chosen[2]].point, &points[3 * v]);
      found.vertex_error = std::max(found.vertex_error, error);
    }
    std::vector<std::int32_t> order(n_faces), renamed(n_vertices, -1);
    for (std::int32_t f = 0; f < n_faces; ++f) order[f] = f;
    std::sort(order.begin(), order.end(), [&](std::int32_t a, std::int32_t b) { return faces[a].row < faces[b].row; });
    found.start.reserve(n_faces + 1);
    found.start.push_back(0);
    found.ring.reserve(ring.size());
    found.rows.reserve(n_faces);
    found.vertices.reserve(points.size());
    found.vertex_rows.reserve(points.size());
    std::int32_t count = 0;
    for (const std::int32_t f : order) {
      stop_.poll(4);
      found.rows.push_back(faces[f].row);
      std::int32_t least = start[f];
      for (std::int32_t j = start[f] + 1; j < start[f + 1]; ++j) {
        if (three[ring[j]] < three[ring[least]]) least = j;
      }
      const std::int32_t n = start[f + 1] - start[f];
      for (std::int32_t j = 0; j < n; ++j) {
        const std::int32_t v = ring[start[f] + (least - start[f] + j) % n];
        if (renamed[v] < 0) {
          renamed[v] = count++;
          for (int k = 0; k < 3; ++k) {
            found.vertices.push_back(points[3 * v + k]);
            found.vertex_rows.push_back(three[v][k]);
          }
        }
        found.ring.push_back(renamed[v]);
      }
      found.start.push_back(static_cast<Index>(found.ring.size()));
    }
  }

  // Of faces in ascending order, three whose planes meet in one point.
  std::array<std::int32_t, 3> widest(const std::int32_t* faces, std::int32_t n, const std::vector<Face>& owner) {
    if (n == 3) return {faces[0], faces[1], faces[2]};
    const double* a = duals_[owner[faces[0]].point].q;
    const auto cross_size = [&](const double* b) {
      const double c[3] = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
      return size_of(c) / size_of(b);
    };
    std::int32_t second = 1, third = -1;
    for (std::int32_t j = 2; j < n; ++j) {
      if (cross_size(duals_[owner[faces[j]].point].q) > cross_size(duals_[owner[faces[second]].point].q)) second = j;
    }
    const double* b = duals_[owner[faces[second]].point].q;
    double best = -1.0;
    for (std::int32_t j = 1; j < n; ++j) {
      if (j == second) continue;
      const double* c = duals_[owner[faces[j]].point].q;
      const double value = std::abs(determinant(a, b, c)) / size_of(c);
      if (value > best && side_or_zero(owner[faces[0]].point, owner[faces[second]].point, owner[faces[j]].point) != 0) {
        best = value;
        third = j;
      }
    }
    return {faces[0], faces[std::min(second, third)], faces[std::max(second, third)]};
  }

  int side_or_zero(Index i, Index j, Index k) {
    const int sign = side(i, j, k);
    return sign == 2 ? exact_.normals_sign(i, j, k) : sign;
  }

  // The vertex in which three planes meet; returns a bound on the error of its coordinates.
  double common_point(Index i, Index j, Index k, double* point) {
    double error = points_.find(i, j, k, point);
    if (std::isfinite(error)) {
      for (int m = 0; m < 3; ++m) point[m] /= planes_.scale;
      return error / planes_.scale;
    }
    exact_.common_point(i, j, k, planes_.scale, point);
    return 0x1p-48 * size_of(point);
  }

  struct Edge {
    std::int32_t from, to, outside;
    int back;
  };
  static constexpr double kCells = 1024.0;
  static constexpr int kFirstShift = 14;

  LocalPlanes planes_;
  Stop& stop_;
  std::vector<std::uint64_t> keys_;
  std::vector<Index> rows_;  // in the order of `sorted`
  Index n_;
  ExactPlanes exact_;
  CommonPoints points_;
  bool is_inside_ = true;
  std::vector<Dual> duals_;
  std::vector<Triangle> triangles_;
  std::vector<Index> first_same_;  // of a dual point, the first of the rows that are the same half-space
  std::vector<std::int32_t> free_, seen_, fresh_, slots_;
  std::vector<Edge> horizon_;
  std::int32_t last_ = 0, stamp_ = 0;
  std::uint32_t random_ = 12345;
};

}  // namespace

HullPolytope dual_hull(const LocalPlanes& planes, const PlaneSource& source, Indices rows, int cube_exponent,
                       Stop& stop) {
  return DualHull(planes, source, rows, cube_exponent, stop).run();
}

}  // namespace voxkernel
