#include "certified_sight.h"

#include <array>

#include "exact_sums.h"
#include "predicates.h"
#include "sight_rays.h"

namespace voxkernel {
namespace {

// The seven points of one question: corners of the facet, the guard, corners of the triangle that may be in the way.
constexpr int kGuard = 3, kOther = 4, kPoints = 7;
using Weights = std::array<int, kPoints>;

// A sum of points with whole weights that add up to 0: a direction, scaled by a power of two. `size` bounds the sum
// of the magnitudes of its terms, which are differences of two points.
struct Direction {
  double value[3];
  double size[3];
  Weights weights;
};

Weights operator-(const Weights& a, const Weights& b) {
  Weights result;
  for (int i = 0; i < kPoints; ++i) result[i] = a[i] - b[i];
  return result;
}

// Whether three rows of small whole numbers are linearly dependent.
bool are_dependent(const Weights& u, const Weights& v, const Weights& w) {
  std::array<std::array<std::int64_t, kPoints>, 3> rows;
  for (int i = 0; i < kPoints; ++i) rows[0][i] = u[i], rows[1][i] = v[i], rows[2][i] = w[i];
  int rank = 0;
  for (int column = 0; column < kPoints && rank < 3; ++column) {
    int pivot = rank;
    while (pivot < 3 && rows[pivot][column] == 0) ++pivot;
    if (pivot == 3) continue;
    std::swap(rows[rank], rows[pivot]);
    for (int r = rank + 1; r < 3; ++r) {
      const std::int64_t a = rows[rank][column], b = rows[r][column];
      for (int i = column; i < kPoints; ++i) rows[r][i] = a * rows[r][i] - b * rows[rank][i];
    }
    ++rank;
  }
  return rank < 3;
}

// What is asked of one point and one part of a facet: does a triangle enter the hull of both?
//
// The inside of the tetrahedron and the triangle are apart iff a plane separates them weakly. It can be taken from a
// finite list: the faces of the tetrahedron, the plane of the triangle, and planes through an edge of the one parallel
// to an edge of the other, because these carry the faces of the difference of both bodies.
class Hull {
 public:
  // `part` holds the weights of the corners of the facet in the three corners of the part; they add up to 2**depth.
  Hull(const double* corners, const double* point, const Index* part, int depth) : scale_(1 << depth) {
    for (int i = 0; i < 3; ++i) points_[i] = corners + 3 * i;
    points_[kGuard] = point;
    for (int c = 0; c < 3; ++c) {
      part_[c].fill(0);
      for (int k = 0; k < 3; ++k) part_[c][k] = static_cast<int>(part[3 * c + k]);
      rays_[c] = from(part_[c], kGuard);
    }
    for (int c = 0; c < 3; ++c) edges_[c] = between(part_[c], part_[(c + 1) % 3]);
    sides_[0] = plain(1, 0), sides_[1] = plain(2, 0);
    make_box();
    make_planes();
  }

  // No point of a box is inside, for certain.
  bool misses(const Box& box) const {
    for (int k = 0; k < 3; ++k) {
      if (box.low[k] >= box_.high[k] || box.high[k] <= box_.low[k]) return true;
    }
    const double* g = points_[kGuard];
    for (const Plane& plane : planes_) {
      double value = 0.0, size = 0.0;
      for (int k = 0; k < 3; ++k) {
        const double far = plane.normal[k] > 0.0 ? box.high[k] - g[k] : box.low[k] - g[k];
        value += plane.normal[k] * far;
        size += plane.size[k] * std::abs(far);
      }
      if (value < -kFilter * size - kTiny) return true;
    }
    return false;
  }

  // A triangle has a point inside.
  bool is_entered(const double* other) {
    for (int i = 0; i < 3; ++i) points_[kOther + i] = other + 3 * i;
    Box box;
    for (int k = 0; k < 3; ++k) {
      box.low[k] = std::min({other[k], other[3 + k], other[6 + k]});
      box.high[k] = std::max({other[k], other[3 + k], other[6 + k]});
    }
    if (misses(box)) return false;
    for (int i = 0; i < 3; ++i) {
      to_other_[i] = plain(kOther + i, kGuard);
      other_edges_[i] = plain(kOther + (i + 1) % 3, kOther + i);
    }
    // First what rounded numbers prove, then every sign.
    is_exact_ = false;
    if (is_apart()) return false;
    is_exact_ = true;
    return !is_apart();
  }

 private:
  struct Plane {
    double normal[3];  // inwards
    double size[3];
  };
  static constexpr int kOpen = 2;  // a sign that the filter leaves open
  // A component of a direction goes through at most 5 roundings (difference, product, two sums, and one to spare); a
  // determinant multiplies three of them, which is 15, and goes through two products, the inner difference and two
  // sums more. So |det - exact| <= ((1 + u)^20 - 1) S with u = 2**-53 and S the exact sum of the magnitudes; the same
  // sum rounded is >= (1 - u)^20 S. 20 u (1 + 41 u) < 2.3e-15. A plane and a box have fewer roundings.
  static constexpr double kFilter = 4e-15;
  static constexpr double kTiny = 1e-290;  // what products lose by underflow, see predicates.cpp

  Direction plain(int to, int from) const {
    Direction d;
    d.weights.fill(0);
    d.weights[to] += scale_;
    d.weights[from] -= scale_;
    for (int k = 0; k < 3; ++k) {
      d.value[k] = points_[to][k] - points_[from][k];
      d.size[k] = std::abs(d.value[k]);
    }
    return d;
  }

  // From a point to a corner of the part.
  Direction from(const Weights& corner, int start) const {
    Direction d;
    d.weights = corner;
    d.weights[start] -= scale_;
    for (int k = 0; k < 3; ++k) {
      d.value[k] = d.size[k] = 0.0;
      for (int i = 0; i < 3; ++i) {
        if (corner[i] == 0) continue;
        const double term = corner[i] * (points_[i][k] - points_[start][k]);
        d.value[k] += term;
        d.size[k] += std::abs(term);
      }
    }
    return d;
  }

  // From one corner of the part to another.
  Direction between(const Weights& first, const Weights& second) const {
    Direction d;
    d.weights = second - first;
    for (int k = 0; k < 3; ++k) {
      d.value[k] = d.size[k] = 0.0;
      for (int i = 1; i < 3; ++i) {
        const double term = d.weights[i] * (points_[i][k] - points_[0][k]);
        d.value[k] += term;
        d.size[k] += std::abs(term);
      }
    }
    return d;
  }

  void make_box() {
    for (int k = 0; k < 3; ++k) {
      // Corners of a part lie between those of the facet; their rounding is below 2**-50 of the largest coordinate.
      double low = points_[kGuard][k], high = low;
      for (int c = 0; c < 3; ++c) {
        double x = 0.0, size = 0.0;
        for (int i = 0; i < 3; ++i) {
          x += part_[c][i] * points_[i][k];
          size += part_[c][i] * std::abs(points_[i][k]);
        }
        const double slack = scale_ > 1 ? 0x1p-49 * size : 0.0;
        low = std::min(low, (x - slack) / scale_);
        high = std::max(high, (x + slack) / scale_);
      }
      box_.low[k] = low;
      box_.high[k] = high;
    }
  }

  void make_planes() {
    for (int c = 0; c < 3; ++c) set_plane(planes_[c], rays_[c], rays_[(c + 1) % 3]);
  }

  // Through the guard; rays turn counter-clockwise seen from it, so normals point inwards.
  static void set_plane(Plane& plane, const Direction& u, const Direction& v) {
    for (int k = 0; k < 3; ++k) {
      const int i = (k + 1) % 3, j = (k + 2) % 3;
      plane.normal[k] = u.value[i] * v.value[j] - u.value[j] * v.value[i];
      plane.size[k] = u.size[i] * v.size[j] + u.size[j] * v.size[i];
    }
  }

  int sign(const Direction& u, const Direction& v, const Direction& w) {
    const double x = u.value[1] * v.value[2] - u.value[2] * v.value[1];
    const double y = u.value[2] * v.value[0] - u.value[0] * v.value[2];
    const double z = u.value[0] * v.value[1] - u.value[1] * v.value[0];
    const double det = x * w.value[0] + y * w.value[1] + z * w.value[2];
    const double size = (u.size[1] * v.size[2] + u.size[2] * v.size[1]) * w.size[0] +
                        (u.size[2] * v.size[0] + u.size[0] * v.size[2]) * w.size[1] +
                        (u.size[0] * v.size[1] + u.size[1] * v.size[0]) * w.size[2];
    if (std::abs(det) > kFilter * size + kTiny) return det > 0.0 ? 1 : -1;
    return is_exact_ ? exact_sign(u, v, w) : kOpen;
  }

  // The same points under two names are one.
  Weights merged(Weights weights) const {
    for (int i = 0; i < kPoints; ++i) {
      for (int j = 0; j < i; ++j) {
        if (weights[i] != 0 && points_[j] != nullptr && std::equal(points_[i], points_[i] + 3, points_[j])) {
          weights[j] += weights[i];
          weights[i] = 0;
        }
      }
    }
    return weights;
  }

  int exact_sign(const Direction& u, const Direction& v, const Direction& w) const {
    const Weights rows[3] = {merged(u.weights), merged(v.weights), merged(w.weights)};
    if (are_dependent(rows[0], rows[1], rows[2])) return 0;
    ExactSum sums[3][3];
    for (int r = 0; r < 3; ++r) {
      for (int k = 0; k < 3; ++k) {
        for (int i = 0; i < kPoints; ++i) {
          if (rows[r][i] != 0) sums[r][k].add_product(rows[r][i], points_[i][k]);
        }
      }
    }
    ExactSum det;
    for (int k = 0; k < 3; ++k) {
      const int i = (k + 1) % 3, j = (k + 2) % 3;
      ExactSum minor = sums[0][i].times(sums[1][j]);
      minor.add(sums[0][j].times(sums[1][i]), -1.0);
      det.add(minor.times(sums[2][k]), 1.0);
    }
    return det.sign();
  }

  static bool is_at_most_0(int sign) { return sign == 0 || sign == -1; }
  static bool is_at_least_0(int sign) { return sign == 0 || sign == 1; }

  bool is_apart() {
    for (int c = 0; c < 3; ++c) {
      if (is_beyond(rays_[c], rays_[(c + 1) % 3])) return true;
    }
    bool is_behind = true;
    for (int i = 0; i < 3 && is_behind; ++i) {
      is_behind = is_at_least_0(sign(sides_[0], sides_[1], plain(kOther + i, 0)));
    }
    if (is_behind || is_on_one_side()) return true;
    for (int c = 0; c < 3; ++c) {
      for (int e = 0; e < 3; ++e) {
        if (separates_at_ray(c, e) || separates_at_edge(c, e)) return true;
      }
    }
    return false;
  }

  // The triangle is beyond the face of the tetrahedron through the guard and two corners.
  bool is_beyond(const Direction& u, const Direction& v) {
    for (int i = 0; i < 3; ++i) {
      if (!is_at_most_0(sign(u, v, to_other_[i]))) return false;
    }
    return true;
  }

  // The tetrahedron is on one side of the triangle's plane; where all is 0 the triangle has no plane.
  bool is_on_one_side() {
    Support support;
    const Direction &u = other_edges_[0], &v = other_edges_[1];
    if (!support.takes(sign(u, v, plain(kGuard, kOther)))) return false;
    for (int c = 0; c < 3; ++c) {
      if (!support.takes(sign(u, v, from(part_[c], kOther)))) return false;
    }
    return support.side != 0;
  }

  // Collects signs that are all >= 0 or all <= 0.
  struct Support {
    int side = 0;
    bool takes(int sign) {
      if (sign == kOpen || sign * side < 0) return false;
      if (sign != 0) side = sign;
      return true;
    }
  };

  // The plane through the edge from the guard to corner c, parallel to edge e of the triangle.
  bool separates_at_ray(int c, int e) {
    const Direction &u = rays_[c], &v = other_edges_[e];
    Support support;
    if (!support.takes(sign(u, v, rays_[(c + 1) % 3])) || !support.takes(sign(u, v, rays_[(c + 2) % 3]))) return false;
    if (support.side == 0) return false;
    support.side = -support.side;
    return support.takes(sign(u, v, to_other_[e])) && support.takes(sign(u, v, to_other_[(e + 2) % 3]));
  }

  // The plane through the edge from corner c to the next, parallel to edge e of the triangle.
  bool separates_at_edge(int c, int e) {
    const Direction &u = edges_[c], &v = other_edges_[e];
    Support support;
    Direction back = rays_[c];
    for (int k = 0; k < 3; ++k) back.value[k] = -back.value[k];
    for (int& weight : back.weights) weight = -weight;
    if (!support.takes(sign(u, v, back)) || !support.takes(sign(u, v, edges_[(c + 1) % 3]))) return false;
    if (support.side == 0) return false;
    support.side = -support.side;
    return support.takes(sign(u, v, negated_from(c, kOther + e))) &&
           support.takes(sign(u, v, negated_from(c, kOther + (e + 2) % 3)));
  }

  // From corner c of the part to a corner of the triangle.
  Direction negated_from(int c, int to) const {
    Direction d = from(part_[c], to);
    for (int k = 0; k < 3; ++k) d.value[k] = -d.value[k];
    for (int& weight : d.weights) weight = -weight;
    return d;
  }

  int scale_;
  const double* points_[kPoints] = {};
  Weights part_[3];
  Direction rays_[3];   // from the guard to the corners of the part
  Direction edges_[3];  // of the part
  Direction sides_[2];  // of the facet
  Direction to_other_[3];
  Direction other_edges_[3];
  Box box_;
  Plane planes_[3];
  bool is_exact_ = true;
};

struct Part {
  Index face;
  Index depth;
  Index weights[9];
};

void round_corners(const double* corners, const Part& part, double* rounded) {
  const double scale = static_cast<double>(1 << part.depth);
  for (int c = 0; c < 3; ++c) {
    for (int k = 0; k < 3; ++k) {
      double sum = 0.0;
      for (int i = 0; i < 3; ++i) {
        const auto weight = static_cast<double>(part.weights[3 * c + i]);
        // Two terms at most on an edge, and their sum is the same from either side.
        if (weight != 0.0) sum += weight * corners[3 * i + k];
      }
      rounded[3 * c + k] = sum / scale;
    }
  }
}

// Assigns parts of facets to points, depth first.
class Certificate {
 public:
  Certificate(const SightTree& tree, Points points, Stop& stop) : tree_(tree), points_(points), stop_(stop) {}

  void add(Index face, const Index* order, Index max_depth) {
    order_ = order;
    max_depth_ = max_depth;
    const auto n = static_cast<std::size_t>(points_.size());
    const double* t = tree_.corners(face);
    while (static_cast<Index>(hiders_.size()) <= max_depth) hiders_.emplace_back(n);
    for (std::size_t i = 0; i < n; ++i) {
      hiders_[0][i] = orientation(t, t + 3, t + 6, points_[static_cast<Index>(i)]) < 0.0 ? kUnknown : kTurnedAway;
    }
    look_at({face, 0, {1, 0, 0, 0, 1, 0, 0, 0, 1}});
  }
  CertifiedParts found;

 private:
  static constexpr Index kUnknown = -1, kTurnedAway = -2;
  static constexpr Index kSureDepth = 3;  // less cut parts are cut further even where no ray arrives

  // `hiders_[part.depth]` is of the part around it, and of this one afterwards.
  void look_at(const Part& part) {
    std::vector<Index>& hiders = hiders_[part.depth];
    double rounded[9], middle[3];
    round_corners(tree_.corners(part.face), part, rounded);
    for (int k = 0; k < 3; ++k) middle[k] = (rounded[k] + rounded[3 + k] + rounded[6 + k]) / 3.0;
    bool is_dark = true;
    for (Index i = 0; i < points_.size(); ++i) {
      const Index point = order_[i];
      Index& hider = hiders[point];
      // A ray first: whoever does not see the middle does not see the whole.
      if (!ray_arrives(part.face, point, middle, hider)) continue;
      is_dark = false;
      if (!is_seen(part, rounded, points_[point], hider)) continue;
      found.faces.push_back(part.face);
      found.points.push_back(point);
      found.depths.push_back(part.depth);
      found.weights.insert(found.weights.end(), part.weights, part.weights + 9);
      found.corners.insert(found.corners.end(), rounded, rounded + 9);
      return;
    }
    if (part.depth < max_depth_ && !(is_dark && part.depth >= kSureDepth && are_corners_dark(part, rounded))) cut(part);
  }

  bool ray_arrives(Index face, Index point, const double* spot, Index& hider) {
    if (hider == kTurnedAway) return false;
    stop_.poll(32);
    const Index between = triangle_between(tree_, points_[point], spot, face, hider);
    if (between >= 0) hider = between;
    return between < 0;
  }

  // No ray arrives at the middles of the three parts at the corners.
  bool are_corners_dark(const Part& part, const double* rounded) {
    for (int c = 0; c < 3; ++c) {
      const double *p = rounded + 3 * c, *q = rounded + 3 * ((c + 1) % 3), *r = rounded + 3 * ((c + 2) % 3);
      double middle[3];
      for (int k = 0; k < 3; ++k) middle[k] = (4.0 * p[k] + q[k] + r[k]) / 6.0;
      for (Index i = 0; i < points_.size(); ++i) {
        if (ray_arrives(part.face, i, middle, hiders_[part.depth][i])) return false;
      }
    }
    return true;
  }

  // The four parts between corners and middles of edges.
  void cut(const Part& part) {
    const Index* w = part.weights;
    Index corner[3][3], middle[3][3];
    for (int c = 0; c < 3; ++c) {
      for (int i = 0; i < 3; ++i) {
        corner[c][i] = 2 * w[3 * c + i];
        middle[c][i] = w[3 * c + i] + w[3 * ((c + 1) % 3) + i];
      }
    }
    const auto look = [&](const Index* a, const Index* b, const Index* c) {
      Part child{part.face, part.depth + 1, {}};
      for (int i = 0; i < 3; ++i) child.weights[i] = a[i], child.weights[3 + i] = b[i], child.weights[6 + i] = c[i];
      hiders_[child.depth] = hiders_[part.depth];
      look_at(child);
    };
    for (int c = 0; c < 3; ++c) look(corner[c], middle[c], middle[(c + 2) % 3]);
    look(middle[0], middle[1], middle[2]);
  }

  // Nothing enters the hull of the point and the part; `hider` is what did so last time. The rounded part must face the
  // point as well, so that it can be a facet of a star-shaped piece.
  bool is_seen(const Part& part, const double* rounded, const double* point, Index& hider) {
    if (part.depth > 0 && !(orientation(rounded, rounded + 3, rounded + 6, point) < 0.0)) return false;
    Hull hull(tree_.corners(part.face), point, part.weights, static_cast<int>(part.depth));
    if (hider >= 0 && hull.is_entered(tree_.corners(hider))) return false;
    NodeStack stack;
    stack.push(0);
    while (stack.size > 0) {
      stop_.poll(8);
      const SightTree::Node& node = tree_.nodes()[stack.pop()];
      if (hull.misses(node.box)) continue;
      if (node.count == 0) {
        stack.push(node.first);
        stack.push(node.first + 1);
        continue;
      }
      for (std::int32_t i = node.first; i < node.first + node.count; ++i) {
        const std::int32_t other = tree_.order()[i];
        if (other == part.face || !hull.is_entered(tree_.corners(other))) continue;
        hider = other;
        return false;
      }
    }
    return true;
  }

  const SightTree& tree_;
  Points points_;
  Stop& stop_;
  const Index* order_ = nullptr;
  Index max_depth_ = 0;
  std::vector<std::vector<Index>> hiders_;  // for each depth and point: a triangle that was in the way
};

}  // namespace

CertifiedParts certify_sight(const SightTree& tree, Points points, Indices faces, Span<const Index> order,
                             Span<const Index> max_depths, Stop& stop) {
  Certificate certificate(tree, points, stop);
  for (Index f = 0; f < faces.size(); ++f) {
    stop.poll();
    certificate.add(faces[f], order.data() + f * points.size(), max_depths[f]);
  }
  return std::move(certificate.found);
}

}  // namespace voxkernel
