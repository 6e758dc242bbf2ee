#include "surface_edges.h"

#include <algorithm>
#include <cstdint>
#include <cstdlib>

#include "buckets.h"
#include "stretches.h"
#include "union_find.h"

namespace voxkernel {
namespace {

bool has_edges(const Index* face) { return face[0] != face[1] && face[1] != face[2] && face[2] != face[0]; }

Index next_half_edge(Index half_edge) { return half_edge % 3 == 2 ? half_edge - 2 : half_edge + 1; }

// In the bucket of its smaller vertex.
template <typename Small>
struct HalfEdge {
  Small other;   // the larger vertex
  Small number;  // twice the half-edge, and one more where it runs from the smaller vertex

  Index half_edge() const { return static_cast<Index>(number / 2); }
  Index is_forward() const { return static_cast<Index>(number % 2); }
};

template <typename Small>
using EdgeBuckets = Buckets<Small, HalfEdge<Small>>;

template <typename Small>
EdgeBuckets<Small> edges_of(Triangles faces, Index n_vertices, Stop& stop) {
  return EdgeBuckets<Small>(n_vertices, [&](auto&& put) {
    for_each(faces.size(), 1, stop, [&](Index f) {
      const Index* face = faces[f];
      if (!has_edges(face)) return;
      for (int k = 0; k < 3; ++k) {
        const Index tail = face[k], head = face[k == 2 ? 0 : k + 1];
        put(std::min(tail, head), [&] {
          const Index number = 2 * (3 * f + k) + static_cast<Index>(tail < head);
          return HalfEdge<Small>{static_cast<Small>(std::max(tail, head)), static_cast<Small>(number)};
        });
      }
    });
  });
}

// Calls `visit(half_edges, n)` for every edge, ordered by the smaller and the larger vertex.
template <typename Small, typename Visit>
void for_each_edge(EdgeBuckets<Small>& buckets, Stop& stop, Visit&& visit) {
  buckets.for_each_bucket(stop, [&](const HalfEdge<Small>* edges, Index n) {
    for (Index first = 0, last = 0; first < n; first = last) {
      while (last < n && edges[last].other == edges[first].other) ++last;
      visit(edges + first, last - first);
    }
  });
}

template <typename Small>
void count_vertices(Triangles faces, Index n_vertices, SurfaceEdges& found, Stop& stop) {
  constexpr std::uint8_t used = 1, of_edges = 2;
  Brief<std::uint8_t> marks(n_vertices, 0);
  UnionFind<Small> joined(n_vertices);
  for_each(faces.size(), 1, stop, [&](Index f) {
    const Index* face = faces[f];
    const bool is_solid = has_edges(face);
    found.n_faces += static_cast<Index>(is_solid);
    for (int k = 0; k < 3; ++k) marks[face[k]] |= is_solid ? used | of_edges : used;
    joined.join(face[0], face[1]);
    joined.join(face[0], face[2]);
  });
  found.n_components = joined.n_parts();
  for (const std::uint8_t mark : marks) {
    found.n_vertices += static_cast<Index>((mark & of_edges) != 0);
    found.n_components -= static_cast<Index>(mark == 0);
  }
}

template <typename Small>
void count_edges(EdgeBuckets<Small>& buckets, SurfaceEdges& found, Stop& stop) {
  Index n_border = 0;
  for_each_edge<Small>(buckets, stop, [&](const HalfEdge<Small>* edges, Index n) {
    Index n_forward = 0;
    for (Index i = 0; i < n; ++i) n_forward += edges[i].is_forward();
    ++found.n_edges;
    n_border += static_cast<Index>(n == 1);
    found.n_nonmanifold += static_cast<Index>(n > 2);
    found.is_oriented = found.is_oriented && std::abs(2 * n_forward - n) <= n % 2;
  });
  found.border.reserve(n_border);
  if (n_border == 0) return;
  for_each_edge<Small>(buckets, stop, [&](const HalfEdge<Small>* edges, Index n) {
    if (n == 1) found.border.push_back(edges->half_edge());
  });
}

// Corners of a closed surface are linked across edges; those of a triangle without edges are alone.
template <typename Small>
Index count_fans(EdgeBuckets<Small>& buckets, Index n_faces, Index n_solid, Stop& stop) {
  UnionFind<Small> corners(3 * n_faces);
  for_each_edge<Small>(buckets, stop, [&](const HalfEdge<Small>* edges, Index /*n*/) {
    const Index left = edges[0].half_edge(), right = edges[1].half_edge();
    corners.join(left, next_half_edge(right));
    corners.join(next_half_edge(left), right);
  });
  return corners.n_parts() - 3 * (n_faces - n_solid);
}

template <typename Small>
void find_parts(EdgeBuckets<Small>& buckets, Triangles faces, SurfaceEdges& found, Stop& stop) {
  UnionFind<Small> joined(faces.size());
  for_each_edge<Small>(buckets, stop, [&](const HalfEdge<Small>* edges, Index /*n*/) {
    joined.join(edges[0].half_edge() / 3, edges[1].half_edge() / 3);
  });
  found.parts = joined.labels([&](Index f) { return has_edges(faces[f]); });
  found.n_parts = joined.n_parts() - (faces.size() - found.n_faces);
}

template <typename Small>
SurfaceEdges surface_edges_with(Triangles faces, Index n_vertices, Stop& stop) {
  SurfaceEdges found;
  count_vertices<Small>(faces, n_vertices, found, stop);
  auto buckets = edges_of<Small>(faces, n_vertices, stop);
  buckets.for_each_bucket(stop, [](HalfEdge<Small>* edges, Index n) {
    std::sort(edges, edges + n, [](const auto& a, const auto& b) { return a.other < b.other; });
  });
  count_edges<Small>(buckets, found, stop);
  if (!found.is_closed() || !found.is_oriented) return found;
  if (found.n_components == 1) found.n_fans = count_fans<Small>(buckets, faces.size(), found.n_faces, stop);
  find_parts<Small>(buckets, faces, found, stop);
  return found;
}

}  // namespace

SurfaceEdges surface_edges(Triangles faces, Index n_vertices, bool is_wide, Stop& stop) {
  const bool is_small = !is_wide && std::max(n_vertices, 6 * faces.size()) <= Index{UINT32_MAX};
  return is_small ? surface_edges_with<std::uint32_t>(faces, n_vertices, stop)
                  : surface_edges_with<std::uint64_t>(faces, n_vertices, stop);
}

}  // namespace voxkernel
