#include <cstdint>
#include <vector>

#include "bind.h"
#include "boundary_loops.h"
#include "duplicate_facets.h"
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
      "ones "
      "of their corners, each with the area of its triangle. In a unit that is a power of two; each product of "
      "coordinates once, in lexical order.");
}

}  // namespace voxkernel
