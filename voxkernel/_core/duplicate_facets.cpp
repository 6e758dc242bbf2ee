#include "duplicate_facets.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "buckets.h"

namespace voxkernel {
namespace {

using Corners = std::vector<Index>;

// Calls `visit(first, last)` for the triangles of every facet.
template <typename Visit>
void for_each_facet(Indices facet_ids, Stop& stop, Visit&& visit) {
  for (Index first = 0, last = 0; first < facet_ids.size(); first = last) {
    while (last < facet_ids.size() && facet_ids[last] == facet_ids[first]) ++last;
    stop.poll(last - first);
    visit(first, last);
  }
}

// Equal neighbours among ordered values.
template <typename T>
Index repeats(const T* values, Index n) {
  Index found = 0;
  for (Index i = 1; i < n; ++i) found += static_cast<Index>(values[i] == values[i - 1]);
  return found;
}

// Triangles, in buckets of their smallest vertex: the two others say it all.
template <typename Small>
Index repeated_triangles(Triangles faces, Indices facet_ids, Index n_vertices, Stop& stop) {
  using Others = std::array<Small, 2>;
  Buckets<Small, Others> buckets(n_vertices, [&](auto&& put) {
    for_each_facet(facet_ids, stop, [&](Index first, Index last) {
      if (last - first > 1) return;
      const Index* face = faces[first];
      std::array<Index, 3> corners{face[0], face[1], face[2]};
      std::sort(corners.begin(), corners.end());
      put(corners[0], [&] { return Others{static_cast<Small>(corners[1]), static_cast<Small>(corners[2])}; });
    });
  });
  Index found = 0;
  buckets.for_each_bucket(stop, [&](Others* others, Index n) {
    std::sort(others, others + n);
    found += repeats(others, n);
  });
  return found;
}

// Facets of several triangles, in buckets of their smallest vertex; a hash of the others tells most of them apart.
template <typename Small>
struct Polygon {
  Small hash;
  Small first;  // triangle
};

Corners corners_of(Triangles faces, Index first, Index last) {
  Corners corners(faces[first], faces[first] + 3 * (last - first));
  std::sort(corners.begin(), corners.end());
  corners.erase(std::unique(corners.begin(), corners.end()), corners.end());
  return corners;
}

std::uint64_t hash_of(const Corners& corners) {
  std::uint64_t mixed = 0;
  for (const Index corner : corners) {
    mixed = (mixed ^ static_cast<std::uint64_t>(corner)) * 0x9E3779B97F4A7C15U;
    mixed ^= mixed >> 29U;
  }
  return mixed;
}

template <typename Small>
Index repeated_polygons(Triangles faces, Indices facet_ids, Index n_vertices, Stop& stop) {
  Buckets<Small, Polygon<Small>> buckets(n_vertices, [&](auto&& put) {
    for_each_facet(facet_ids, stop, [&](Index first, Index last) {
      if (last - first == 1) return;
      const Index* ids = faces[first];
      put(*std::min_element(ids, ids + 3 * (last - first)), [&] {
        const std::uint64_t hash = hash_of(corners_of(faces, first, last));
        return Polygon<Small>{static_cast<Small>(hash), static_cast<Small>(first)};
      });
    });
  });
  const auto end_of = [&](Index first) {
    Index last = first;
    while (last < facet_ids.size() && facet_ids[last] == facet_ids[first]) ++last;
    return last;
  };
  Index found = 0;
  std::vector<Corners> alike;
  buckets.for_each_bucket(stop, [&](Polygon<Small>* polygons, Index n) {
    std::sort(polygons, polygons + n, [](const auto& a, const auto& b) { return a.hash < b.hash; });
    for (Index first = 0, last = 0; first < n; first = last) {
      while (last < n && polygons[last].hash == polygons[first].hash) ++last;
      if (last - first == 1) continue;
      alike.clear();
      for (Index i = first; i < last; ++i) {
        const auto triangle = static_cast<Index>(polygons[i].first);
        alike.push_back(corners_of(faces, triangle, end_of(triangle)));
      }
      std::sort(alike.begin(), alike.end());
      found += repeats(alike.data(), static_cast<Index>(alike.size()));
    }
  });
  return found;
}

template <typename Small>
Index duplicate_facets_with(Triangles faces, Indices facet_ids, Index n_vertices, Stop& stop) {
  return repeated_triangles<Small>(faces, facet_ids, n_vertices, stop) +
         repeated_polygons<Small>(faces, facet_ids, n_vertices, stop);
}

}  // namespace

Index duplicate_facets(Triangles faces, Indices facet_ids, Index n_vertices, bool is_wide, Stop& stop) {
  const bool is_small = !is_wide && std::max(n_vertices, faces.size()) <= Index{UINT32_MAX};
  return is_small ? duplicate_facets_with<std::uint32_t>(faces, facet_ids, n_vertices, stop)
                  : duplicate_facets_with<std::uint64_t>(faces, facet_ids, n_vertices, stop);
}

}  // namespace voxkernel
