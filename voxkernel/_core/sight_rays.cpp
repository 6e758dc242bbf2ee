#include "sight_rays.h"

#include <limits>

#include "predicates.h"
#include "sphere_vector.h"

namespace voxkernel {
namespace {

using namespace sphere;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
// Where a segment ends at a spot, what is this near to its end is the surface of the spot itself.
constexpr double kEnd = 1.0 - 1e-9;
// Rays are let through nowhere between two triangles.
constexpr double kRim = 1e-12;

struct Ray {
  Vector start, along;
  double inverse[3];
};

// Never infinite, so that its product with 0 is 0.
double inverse_of(double x) { return std::abs(x) > 1e-300 ? 1.0 / x : 1e300; }

Ray ray_of(const double* start, Vector along) {
  return {vector(start), along, {inverse_of(along.x), inverse_of(along.y), inverse_of(along.z)}};
}

// Whether the part 0..end of a ray meets a box, and from where on.
bool meets(const Box& box, const Ray& ray, double end, double& from) {
  const double start[3] = {ray.start.x, ray.start.y, ray.start.z};
  double low = 0.0, high = end;
  for (int k = 0; k < 3; ++k) {
    const double a = (box.low[k] - start[k]) * ray.inverse[k], b = (box.high[k] - start[k]) * ray.inverse[k];
    const double near = a < b ? a : b, far = (a < b ? b : a) * (1.0 + 1e-15);
    if (near > low) low = near;
    if (far < high) high = far;
  }
  from = low;
  return low <= high;
}

struct Crossing {
  double at;    // in lengths of the ray; infinite where it passes by
  double turn;  // > 0 where the ray leaves through the outer side
};

// Moeller and Trumbore, "Fast, minimum storage ray/triangle intersection", 1997.
Crossing crossing(const Ray& ray, const double* t) {
  const Vector a = vector(t), u = vector(t + 3) - a, v = vector(t + 6) - a;
  const Vector p = cross(ray.along, v);
  const double det = dot(u, p);
  if (det == 0.0) return {kInfinity, 0.0};
  const double inverse = 1.0 / det;
  const Vector s = ray.start - a;
  const double x = dot(s, p) * inverse;
  if (!(x >= -kRim && x <= 1.0 + kRim)) return {kInfinity, 0.0};
  const Vector q = cross(s, u);
  const double y = dot(ray.along, q) * inverse;
  if (!(y >= -kRim && x + y <= 1.0 + kRim)) return {kInfinity, 0.0};
  return {dot(v, q) * inverse, -det};
}

// Calls `visit(face)` for the triangles whose boxes the part of a ray up to `end` meets, until it says true.
template <typename Visit>
bool walk(const SightTree& tree, const Ray& ray, const double& end, Visit&& visit) {
  const auto& nodes = tree.nodes();
  const auto& order = tree.order();
  NodeStack stack;
  double from;
  if (!meets(nodes[0].box, ray, end, from)) return false;
  stack.push(0);
  while (stack.size > 0) {
    const SightTree::Node& node = nodes[stack.pop()];
    if (node.count > 0) {
      for (std::int32_t i = node.first; i < node.first + node.count; ++i) {
        if (visit(order[i])) return true;
      }
      continue;
    }
    double left, right;
    const bool is_left = meets(nodes[node.first].box, ray, end, left);
    const bool is_right = meets(nodes[node.first + 1].box, ray, end, right);
    if (is_left && is_right) {
      const int nearer = right < left ? 1 : 0;
      stack.push(node.first + 1 - nearer);
      stack.push(node.first + nearer);
    } else if (is_left || is_right) {
      stack.push(node.first + (is_right ? 1 : 0));
    }
  }
  return false;
}

// Looks along a segment; remembers what was in the way, which often is in the way of the next one, too.
class Looker {
 public:
  explicit Looker(const SightTree& tree, Index guess = -1) : tree_(tree), last_(guess) {}

  bool sees(const double* point, const double* spot, Index face) {
    const double* t = tree_.corners(face);
    return orientation(t, t + 3, t + 6, point) < 0.0 && between(point, spot, face) < 0;
  }

  // A triangle on the way, -1 where there is none.
  Index between(const double* point, const double* spot, Index face) {
    const Ray ray = ray_of(point, difference(spot, point));
    const auto blocks = [&](Index other) {
      if (other == face) return false;
      const double at = crossing(ray, tree_.corners(other)).at;
      return at > 0.0 && at < kEnd;
    };
    if (last_ >= 0 && blocks(last_)) return last_;
    const double end = kEnd;
    const bool is_blocked = walk(tree_, ray, end, [&](Index other) {
      if (!blocks(other)) return false;
      last_ = other;
      return true;
    });
    return is_blocked ? last_ : -1;
  }

 private:
  const SightTree& tree_;
  Index last_;
};

// The point of a triangle nearest to p (Ericson, Real-Time Collision Detection, 5.1.5).
Vector nearest_in_triangle(Vector p, const double* t) {
  const Vector a = vector(t), b = vector(t + 3), c = vector(t + 6);
  const Vector ab = b - a, ac = c - a, ap = p - a, bp = p - b, cp = p - c;
  const double d1 = dot(ab, ap), d2 = dot(ac, ap), d3 = dot(ab, bp), d4 = dot(ac, bp), d5 = dot(ab, cp),
               d6 = dot(ac, cp);
  if (d1 <= 0.0 && d2 <= 0.0) return a;
  if (d3 >= 0.0 && d4 <= d3) return b;
  if (d6 >= 0.0 && d5 <= d6) return c;
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0) return d1 > d3 ? a + ab * (d1 / (d1 - d3)) : a;
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0) return d2 > d6 ? a + ac * (d2 / (d2 - d6)) : a;
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0.0 && d4 >= d3 && d5 >= d6) return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
  return a + ab * (vb / (va + vb + vc)) + ac * (vc / (va + vb + vc));
}

double squared_distance(const Box& box, const double* p) {
  double sum = 0.0;
  for (int k = 0; k < 3; ++k) {
    const double d = std::max(0.0, std::max(box.low[k] - p[k], p[k] - box.high[k]));
    sum += d * d;
  }
  return sum;
}

}  // namespace

void points_see(const SightTree& tree, Points points, Points spots, Indices spot_faces, Span<std::uint64_t> words,
                Stop& stop) {
  const Index n_words = (spots.size() + 63) / 64;
  for (Index i = 0; i < points.size(); ++i) {
    Looker looker(tree);
    for (Index j = 0; j < spots.size(); ++j) {
      stop.poll(32);
      if (looker.sees(points[i], spots[j], spot_faces[j])) {
        words[i * n_words + j / 64] |= std::uint64_t{1} << (j % 64);
      }
    }
  }
}

void pairs_see(const SightTree& tree, Points points, Points spots, Indices spot_faces, Span<bool> seen, Stop& stop) {
  Looker looker(tree);
  for (Index i = 0; i < points.size(); ++i) {
    stop.poll(32);
    seen[i] = looker.sees(points[i], spots[i], spot_faces[i]);
  }
}

Index triangle_between(const SightTree& tree, const double* point, const double* spot, Index face, Index guess) {
  return Looker(tree, guess).between(point, spot, face);
}

void first_hits(const SightTree& tree, Points starts, Points directions, Indices skip, Span<double> at, Stop& stop) {
  for (Index i = 0; i < starts.size(); ++i) {
    stop.poll(64);
    const Ray ray = ray_of(starts[i], vector(directions[i]));
    double nearest = kInfinity;
    walk(tree, ray, nearest, [&](Index face) {
      if (face == skip[i]) return false;
      const double found = crossing(ray, tree.corners(face)).at;
      if (found > 0.0 && found < nearest) nearest = found;
      return false;
    });
    at[i] = nearest;
  }
}

void winding_numbers(const SightTree& tree, Points points, Span<Index> windings, Stop& stop) {
  // Any direction will do; these are parallel to no edge that somebody draws. Two of three have it.
  constexpr Vector along[3] = {
      {0.5390219, 0.3361527, 0.7722981}, {-0.6130243, 0.7133871, 0.3396417}, {0.2816553, -0.8811427, 0.3798143}};
  const double end = kInfinity;
  for (Index i = 0; i < points.size(); ++i) {
    Index found[3] = {};
    for (int r = 0; r < 3; ++r) {
      stop.poll(64);
      if (r == 2 && found[0] == found[1]) break;
      const Ray ray = ray_of(points[i], along[r]);
      walk(tree, ray, end, [&](Index face) {
        const Crossing hit = crossing(ray, tree.corners(face));
        if (hit.at > 0.0 && hit.at < kInfinity) found[r] += hit.turn > 0.0 ? 1 : -1;
        return false;
      });
    }
    windings[i] = found[0] == found[1] || found[0] == found[2] ? found[0] : found[1];
  }
}

void nearest_points(const SightTree& tree, Points points, Rows<double, 3> nearest, Span<double> distances, Stop& stop) {
  const auto& nodes = tree.nodes();
  for (Index i = 0; i < points.size(); ++i) {
    const double* p = points[i];
    double best = kInfinity;
    Vector found{0.0, 0.0, 0.0};
    NodeStack stack;
    stack.push(0);
    while (stack.size > 0) {
      stop.poll(4);
      const SightTree::Node& node = nodes[stack.pop()];
      if (squared_distance(node.box, p) >= best) continue;
      if (node.count > 0) {
        for (std::int32_t k = node.first; k < node.first + node.count; ++k) {
          const Vector q = nearest_in_triangle(vector(p), tree.corners(tree.order()[k]));
          const Vector d = q - vector(p);
          const double size = dot(d, d);
          if (size < best) best = size, found = q;
        }
        continue;
      }
      const double left = squared_distance(nodes[node.first].box, p);
      const double right = squared_distance(nodes[node.first + 1].box, p);
      const int nearer = right < left ? 1 : 0;
      if (std::max(left, right) < best) stack.push(node.first + 1 - nearer);
      stack.push(node.first + nearer);
    }
    distances[i] = std::sqrt(best);
    nearest(i, 0) = found.x;
    nearest(i, 1) = found.y;
    nearest(i, 2) = found.z;
  }
}

}  // namespace voxkernel
