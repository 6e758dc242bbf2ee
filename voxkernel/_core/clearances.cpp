#include "clearances.h"

#include <limits>

#include "sphere_vector.h"

namespace voxkernel {
namespace {

using namespace sphere;

constexpr double kRound = 1e-14;  // above the roundings of a triple product of differences, over its magnitudes

double distance_from_segment(Vector p, Vector a, Vector b) {
  const Vector along = b - a, to = p - a;
  const double size = dot(along, along);
  const double t = size > 0.0 ? std::min(1.0, std::max(0.0, dot(to, along) / size)) : 0.0;
  return length(to - along * t);
}

// Where the point is beyond an edge for certain, the distance is that of the edges. Elsewhere it is no less than the
// distance from the plane, and no less than that from the edges without the least height, since no point of the
// triangle is farther from its edges; the plane of a sliver is not known, but its height is small.
double distance_below(Vector p, const double* t) {
  const Vector corners[3] = {vector(t), vector(t + 3), vector(t + 6)};
  const Vector u = corners[1] - corners[0], v = corners[2] - corners[0];
  const Vector normal = cross(u, v);
  const double blur = kRound * length(u) * length(v);
  double edges = std::numeric_limits<double>::infinity(), longest = 0.0;
  bool is_beyond = false;
  for (int k = 0; k < 3; ++k) {
    const Vector a = corners[k], b = corners[(k + 1) % 3];
    edges = std::min(edges, distance_from_segment(p, a, b));
    const double size = length(b - a), reach = length(p - a);
    longest = std::max(longest, size);
    const double side = dot(cross(b - a, p - a), normal);
    is_beyond = is_beyond || side < -(blur + kRound * length(normal)) * size * reach;
  }
  if (is_beyond) return edges;
  const double size = length(normal);
  double below = edges - (size + blur) / longest;
  if (size > 2.0 * blur) {
    const Vector to = p - corners[0];
    const double reach = length(to);
    below = std::max(below, (std::abs(dot(to, normal)) - 2.0 * blur * reach) / (size + blur) - kRound * reach);
  }
  return std::max(0.0, std::min(edges, below));
}

double distance_below(Vector p, const Box& box) {
  const double at[3] = {p.x, p.y, p.z};
  double sum = 0.0;
  for (int k = 0; k < 3; ++k) {
    const double d = std::max(0.0, std::max(box.low[k] - at[k], at[k] - box.high[k]));
    sum += d * d;
  }
  return std::sqrt(sum);
}

}  // namespace

void clearances(const SightTree& tree, Points points, Span<double> distances, Stop& stop) {
  const auto& nodes = tree.nodes();
  for (Index i = 0; i < points.size(); ++i) {
    const Vector p = vector(points[i]);
    double best = std::numeric_limits<double>::infinity();
    NodeStack stack;
    stack.push(0);
    while (stack.size > 0) {
      stop.poll(4);
      const SightTree::Node& node = nodes[stack.pop()];
      if (distance_below(p, node.box) >= best) continue;
      if (node.count > 0) {
        for (std::int32_t k = node.first; k < node.first + node.count; ++k) {
          best = std::min(best, distance_below(p, tree.corners(tree.order()[k])));
        }
        continue;
      }
      const double left = distance_below(p, nodes[node.first].box);
      const double right = distance_below(p, nodes[node.first + 1].box);
      const int nearer = right < left ? 1 : 0;
      if (std::max(left, right) < best) stack.push(node.first + 1 - nearer);
      stack.push(node.first + nearer);
    }
    distances[i] = best;
  }
}

}  // namespace voxkernel
