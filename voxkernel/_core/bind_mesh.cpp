#include <nanobind/stl/array.h>
#include <nanobind/stl/vector.h>

#include <array>
#include <cstdint>
#include <tuple>
#include <utility>
#include <vector>

#include "bind.h"
#include "boundary_loops.h"
#include "duplicate_facets.h"
#include "polygon_cuts.h"
#include "surface_edges.h"
#include "triangle_sums.h"

namespace voxkernel {

namespace {

template <typename Id>
nb::tuple loops_of(Array2<const Index, 3> faces, Index n_vertices, Array1<const Index> border) {
  Loops<Id> loops;
  without_lock([&](Stop& stop) { find_boundary_loops<Id>(rows(faces), n_vertices, span(border), loops, stop); });
  return nb::make_tuple(take_array(loops.vertices), take_array(loops.starts));
}

Array2<Index, 3> take_rows(GrowingArray<Index>& values) {
  const auto n = static_cast<std::size_t>(values.size()) / 3;
  Index* data = values.release();
  nb::capsule owner(data, [](void* p) noexcept { std::free(p); });
  return Array2<Index, 3>(data, {n, 3}, owner);
}

auto cuts_of(Points points, Indices flat, Indices sizes, int exponent, double rtol) {
  PolygonCuts cuts = without_lock([&](Stop& stop) { return PolygonCuts(points, flat, sizes, exponent, rtol, stop); });
  std::vector<std::tuple<Index, Index, Index, Index, std::array<double, 3>>> unfanned;
  unfanned.reserve(cuts.unfanned.size());
  for (const Unfanned& one : cuts.unfanned) {
    unfanned.emplace_back(one.polygon, one.corner, one.triangle, one.plane, one.newell);
  }
  return std::make_tuple(to_rows<3>(std::move(cuts.triangles)), to_array(std::move(cuts.facet_ids)),
                         take_rows(cuts.plane_corners), take_array(cuts.plane_facets), take_array(cuts.plane_areas),
                         take_array(cuts.nonplanar), std::move(unfanned));
}

}  // namespace

void bind_mesh(nb::module_& m) {
  m.def(
      "surface_edges",
      [](Array2<const Index, 3> faces, Index n_vertices, bool is_wide) {
        SurfaceEdges found =
            without_lock([&](Stop& stop) { return surface_edges(rows(faces), n_vertices, is_wide, stop); });
        return std::make_tuple(found.n_faces, found.n_vertices, found.n_edges, found.n_nonmanifold,
                               to_array(std::move(found.border)), found.is_oriented, found.n_components, found.n_fans,
                               found.n_parts, to_array(std::move(found.parts)));
      },
      array("faces"), nb::arg("n_vertices"), nb::arg("is_wide") = false,
      "Triangles with edges, their vertices and edges, those of three triangles or more, half-edges of the border; "
      "whether oriented, components by vertices, fans; parts by edges and that of each triangle.");
  m.def(
      "boundary_loops",
      [](Array2<const Index, 3> faces, Index n_vertices, Array1<const Index> border, bool is_wide) {
        return !is_wide && is_small_border(n_vertices, span(border))
                   ? loops_of<std::int32_t>(faces, n_vertices, border)
                   : loops_of<std::int64_t>(faces, n_vertices, border);
      },
      array("faces"), nb::arg("n_vertices"), array("border"), nb::arg("is_wide") = false,
      "Chain half-edges into simple loops of vertices; and where each loop starts, and the end. Of 32 bits where these "
      "do.");
  m.def(
      "duplicate_facets",
      [](Array2<const Index, 3> faces, Array1<const Index> facet_ids, Index n_vertices, bool is_wide) {
        return without_lock(
            [&](Stop& stop) { return duplicate_facets(rows(faces), span(facet_ids), n_vertices, is_wide, stop); });
      },
      array("faces"), array("facet_ids"), nb::arg("n_vertices"), nb::arg("is_wide") = false,
      "Count the facets that have the corners of an earlier one.");
  m.def(
      "triangle_areas",
      [](Array2<const double, 3> vertices, Array2<const Index, 3> triangles, int exponent) {
        std::vector<double> areas(triangles.shape(0));
        without_lock(
            [&](Stop& stop) { triangle_areas(rows(vertices), rows(triangles), exponent, Span<double>(areas), stop); });
        return to_array(std::move(areas));
      },
      array("vertices"), array("triangles"), nb::arg("exponent"), "Areas in units of 4**exponent.");
  m.def(
      "triangle_moments",
      [](Array2<const double, 3> vertices, Array2<const Index, 3> triangles, Array<const double, 3> base, double unit) {
        const TriangleMoments sums = without_lock([&](Stop& stop) {
          return triangle_moments(rows(vertices), rows(triangles), {base(0), base(1), base(2)}, unit, stop);
        });
        const auto array = [](const auto& values) {
          return to_array(std::vector<double>(values.begin(), values.end()));
        };
        return nb::make_tuple(sums.area, array(sums.first), array(sums.second), array(sums.third), array(sums.corners));
      },
      array("vertices"), array("triangles"), array("base"), nb::arg("unit"),
      "Area; first, second and third moments about `base` of triangles taken as points in their middles, and second "
      "ones of their corners, each with the area of its triangle. In a unit that is a power of two; each product of "
      "coordinates once, in lexical order.");
  m.def(
      "cut_polygons",
      [](Array2<const double, 3> points, Array1<const Index> flat, Array1<const Index> sizes, int exponent,
         double rtol) { return cuts_of(rows(points), span(flat), span(sizes), exponent, rtol); },
      array("points"), array("flat"), array("sizes"), nb::arg("exponent"), nb::arg("rtol"),
      "Triangles and their facets; planes as corners, facets and areas; facets that are not planar; and of those "
      "without "
      "a fan the facet, its first corner, triangle and plane (-1: planar) and the area vector.");
  m.def(
      "fill_triangle_areas",
      [](Array2<const double, 3> points, Array2<const Index, 3> corners, int exponent, Array1<double> areas) {
        without_lock(
            [&](Stop& stop) { fill_triangle_areas(rows(points), rows(corners), exponent, span(areas), stop); });
      },
      array("points"), array("corners"), nb::arg("exponent"), array("areas"),
      "Fill the areas that are negative with those of triangles.");
}

}  // namespace voxkernel
