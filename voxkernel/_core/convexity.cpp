#include "convexity.h"

#include <algorithm>
#include <atomic>
#include <cstdint>

#include "pages.h"
#include "predicates.h"
#include "shared_buckets.h"
#include "stretches.h"
#include "workers.h"

namespace voxkernel {
namespace {

constexpr Index kLeast = 1 << 14;  // vertices or faces that are worth a thread
constexpr int kMostParts = 8;      // each counts the triangles of every vertex

Index next_corner(const Index* face, int k) { return face[k == 2 ? 0 : k + 1]; }

bool are_equal(const Index* p, const Index* q) { return p[0] == q[0] && p[1] == q[1] && p[2] == q[2]; }

// Edge k of face f, from corner k to corner k + 1, is half-edge 3 f + k. `Small` holds vertices and half-edges.
template <typename Small>
struct HalfEdge {
  Small other;  // the larger vertex
  Small edge;
};

struct Surface {
  Points vertices;
  Triangles faces;
  Indices face_planes;
  Triangles plane_corners;

  Index begin(Index edge) const { return faces(edge / 3, edge % 3); }

  // The side of the plane of one face on which the far corner of its neighbour lies: 0 on it, positive beyond.
  double side(Index one, Index two) const {
    const Index* corners = plane_corners[face_planes[one / 3]];
    const Index far = faces(two / 3, (two % 3 + 2) % 3);
    return orientation(vertices[corners[0]], vertices[corners[1]], vertices[corners[2]], vertices[far]);
  }

  // 2 where two faces meet in a strictly convex edge, or are one plane; 1 in a flat edge, 0 in a concave one.
  int convexity(Index one, Index two) const {
    const Index plane = face_planes[one / 3], neighbour = face_planes[two / 3];
    if (plane == neighbour) return 2;
    double worst = side(one, two);
    // Seen from the other triangle it is the same sign of the same four corners; planes of polygons are both asked.
    const bool is_same_sign =
        are_equal(plane_corners[plane], faces[one / 3]) && are_equal(plane_corners[neighbour], faces[two / 3]);
    if (worst <= 0.0 && !is_same_sign) worst = std::max(worst, side(two, one));
    return worst > 0.0 ? 0 : (worst == 0.0 ? 1 : 2);
  }
};

// The least convexity of the edges whose smaller vertex is one; 0 where one has not two faces that pass it both ways.
template <typename Small>
int edges_of_vertex(const Surface& surface, HalfEdge<Small>* edges, Index n) {
  // In any order where the other vertex is the same: only pairs are used, and both ways.
  std::sort(edges, edges + n, [](const auto& a, const auto& b) { return a.other < b.other; });
  int worst = 2;
  for (Index i = 0; i < n && worst > 0; i += 2) {
    const bool is_pair =
        i + 1 < n && edges[i].other == edges[i + 1].other && (i + 2 == n || edges[i + 2].other != edges[i].other);
    if (!is_pair) return 0;
    const auto one = static_cast<Index>(edges[i].edge), two = static_cast<Index>(edges[i + 1].edge);
    if (surface.begin(one) == surface.begin(two)) return 0;
    worst = std::min(worst, surface.convexity(one, two));
  }
  return worst;
}

template <typename Small>
int edge_convexity_with(const Surface& surface, int least, int threads, Stop& stop) {
  const Triangles faces = surface.faces;
  const auto each_edge = [&](Index first, Index last, Stop& own, auto&& put) {
    for_each(last - first, 1, own, [&](Index i) {
      const Index f = first + i;
      for (int k = 0; k < 3; ++k) {
        const Index from = faces(f, k), to = next_corner(faces[f], k);
        put(std::min(from, to),
            [&] { return HalfEdge<Small>{static_cast<Small>(std::max(from, to)), static_cast<Small>(3 * f + k)}; });
      }
    });
  };
  SharedBuckets<Small, HalfEdge<Small>> buckets(surface.vertices.size(), faces.size(), kLeast, threads, stop,
                                                each_edge);
  // The least answer of all vertices; 0 ends the others.
  std::atomic<int> answer{2};
  buckets.for_each_bucket(stop, [&](HalfEdge<Small>* edges, Index n) {
    const int worst = edges_of_vertex(surface, edges, n);
    int before = answer.load(std::memory_order_relaxed);
    const int now = worst < least ? 0 : worst;
    while (now < before && !answer.compare_exchange_weak(before, now)) {
    }
    return answer.load(std::memory_order_relaxed) > 0;
  });
  return answer;
}

}  // namespace

// Tests every edge between two facets: 2 all strictly convex, 1 some flat, 0 some concave, or one that does not have
// two faces which traverse it in opposite directions. An answer below `least` becomes 0, found with the first edge that
// says so. Half-edges are bucketed by their smaller vertex, so the time is linear.
int edge_convexity(Points vertices, Triangles faces, Indices face_planes, Triangles plane_corners, int least,
                   int threads, Stop& stop) {
  const Surface surface{vertices, faces, face_planes, plane_corners};
  const bool is_small = std::max(vertices.size(), 3 * faces.size()) <= Index{UINT32_MAX};
  return is_small ? edge_convexity_with<std::uint32_t>(surface, least, threads, stop)
                  : edge_convexity_with<std::uint64_t>(surface, least, threads, stop);
}

UsedVertices used_vertices(Points vertices, Triangles faces, const double* origin, double scale, const double* point,
                           int threads, Stop& stop) {
  Brief<std::int32_t> number(vertices.size(), -1);
  for_each(faces.size(), 1, stop, [&](Index f) {
    for (int k = 0; k < 3; ++k) number[faces(f, k)] = 0;
  });
  std::int32_t count = 0;
  for (std::int32_t& one : number) {
    if (one == 0) one = count++;
  }
  UsedVertices found;
  found.vertices.resize(static_cast<std::size_t>(3) * count);
  run_stretches(vertices.size(), kLeast, threads, stop, [&](Index first, Index last, Stop& own) {
    own.poll(last - first);
    for (Index v = first; v < last; ++v) {
      if (number[v] < 0) continue;
      double* moved = &found.vertices[3 * static_cast<Index>(number[v])];
      for (int k = 0; k < 3; ++k) moved[k] = (vertices(v, k) - origin[k]) / scale - point[k];
    }
  });
  found.ring.resize(static_cast<std::size_t>(3) * faces.size());
  run_stretches(faces.size(), kLeast, threads, stop, [&](Index first, Index last, Stop& own) {
    own.poll(last - first);
    for (Index f = first; f < last; ++f) {
      for (int k = 0; k < 3; ++k) found.ring[3 * f + k] = number[faces(f, k)];
    }
  });
  return found;
}

UnfilledVector<std::int32_t> triangles_at_vertices(SmallIndices ring, Index n, int threads, Stop& stop) {
  const Index n_triangles = ring.size() / 3;
  const int n_parts = worth_threads(n_triangles, kLeast, std::min(threads, kMostParts));
  // How many of the triangles before a part, and of all, have a vertex.
  std::vector<Brief<std::int32_t>> seen(n_parts);
  Brief<std::int32_t> count(n);
  const auto each_corner = [&](int part, Stop& own, auto&& visit) {
    const Index first = part_begin(n_triangles, n_parts, part), last = part_begin(n_triangles, n_parts, part + 1);
    for_each(last - first, 3, own, [&](Index i) {
      for (int k = 0; k < 3; ++k) visit(ring[3 * (first + i) + k], static_cast<std::int32_t>(first + i));
    });
  };
  run_parts(n_parts, stop, [&](int part, Stop& own) {
    seen[part].assign(n, 0);
    each_corner(part, own, [&](std::int32_t v, std::int32_t) { ++seen[part][v]; });
  });
  run_stretches(n, kLeast, threads, stop, [&](Index first, Index last, Stop& own) {
    own.poll(last - first);
    for (Index v = first; v < last; ++v) {
      std::int32_t sum = 0;
      for (Brief<std::int32_t>& part : seen) {
        const std::int32_t here = part[v];
        part[v] = sum;
        sum += here;
      }
      count[v] = sum;
    }
  });
  UnfilledVector<std::int32_t> found(3 * n);
  run_parts(n_parts, stop, [&](int part, Stop& own) {
    each_corner(part, own, [&](std::int32_t v, std::int32_t triangle) {
      const std::int32_t place = seen[part][v]++;
      std::int32_t* three = &found[3 * static_cast<Index>(v)];
      if (place == 0) three[0] = triangle;
      if (place == count[v] / 2) three[1] = triangle;
      if (place == count[v] - 1) three[2] = triangle;
    });
  });
  return found;
}

}  // namespace voxkernel
