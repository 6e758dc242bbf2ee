#include "convexity.h"

#include <algorithm>

#include "predicates.h"

namespace voxkernel {
namespace {

struct HalfEdge {
  Index other;  // the larger vertex
  Index edge;
};

Index next_corner(const Index* face, int k) { return face[k == 2 ? 0 : k + 1]; }

}  // namespace

// Pairs the half-edges of a surface: edge k of face f is 3 f + k, from corner k to corner k + 1.
// -1 where an edge does not have exactly two faces that traverse it in opposite directions.
// Half-edges are bucketed by their smaller vertex, so the time is linear.
std::vector<Index> halfedge_twins(Triangles faces, Index n_vertices, Stop& stop) {
  std::vector<Index> start(n_vertices + 1, 0);
  for (Index f = 0; f < faces.size(); ++f) {
    stop.poll();
    for (int k = 0; k < 3; ++k) ++start[std::min(faces(f, k), next_corner(faces[f], k)) + 1];
  }
  for (Index v = 0; v < n_vertices; ++v) start[v + 1] += start[v];
  std::vector<Index> fill(start.begin(), start.end() - 1);
  std::vector<HalfEdge> edges(3 * faces.size());
  for (Index f = 0; f < faces.size(); ++f) {
    stop.poll();
    for (int k = 0; k < 3; ++k) {
      const Index a = faces(f, k), b = next_corner(faces[f], k);
      edges[fill[std::min(a, b)]++] = {std::max(a, b), 3 * f + k};
    }
  }
  const auto begins_at = [&](Index edge) { return faces(edge / 3, edge % 3); };
  std::vector<Index> twins(3 * faces.size(), -1);
  for (Index v = 0; v < n_vertices; ++v) {
    const Index high = start[v + 1];
    stop.poll(1 + high - start[v]);
    // In any order where the other vertex is the same: only pairs are used, and both ways.
    std::sort(edges.begin() + start[v], edges.begin() + high,
              [](const HalfEdge& a, const HalfEdge& b) { return a.other < b.other; });
    for (Index j = start[v]; j < high;) {
      Index end = j + 1;
      while (end < high && edges[end].other == edges[j].other) ++end;
      const Index one = edges[j].edge;
      if (end - j == 2) {
        const Index two = edges[j + 1].edge;
        if (begins_at(one) != begins_at(two)) {
          twins[one] = two;
          twins[two] = one;
        }
      }
      j = end;
    }
  }
  return twins;
}

// Tests every edge between two facets: 2 all strictly convex, 1 some flat, 0 some concave or without twin.
int edge_convexity(Points vertices, Triangles faces, Indices twins, Indices face_planes, Triangles plane_corners,
                   Stop& stop) {
  int answer = 2;
  for (Index edge = 0; edge < twins.size(); ++edge) {
    stop.poll();
    const Index other = twins[edge];
    if (other < 0) return 0;
    const Index plane = face_planes[edge / 3];
    if (plane == face_planes[other / 3]) continue;
    const Index* corners = plane_corners[plane];
    const Index far = faces(other / 3, (other % 3 + 2) % 3);
    const double side = orientation(vertices[corners[0]], vertices[corners[1]], vertices[corners[2]], vertices[far]);
    if (side > 0.0) return 0;
    if (side == 0.0) answer = 1;
  }
  return answer;
}

}  // namespace voxkernel
