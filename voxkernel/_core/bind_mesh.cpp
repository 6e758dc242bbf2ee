#include "bind.h"
#include "boundary_loops.h"
#include "duplicate_facets.h"
#include "surface_edges.h"

namespace voxkernel {

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
      [](Array2<const Index, 3> faces, Index n_vertices, Array1<const Index> border) {
        Loops loops =
            without_lock([&](Stop& stop) { return boundary_loops(rows(faces), n_vertices, span(border), stop); });
        return std::make_tuple(to_read_only(std::move(loops.vertices)), to_array(std::move(loops.starts)));
      },
      array("faces"), nb::arg("n_vertices"), array("border"),
      "Chain half-edges into simple loops of vertices; and where each loop starts, and the end.");
  m.def(
      "duplicate_facets",
      [](Array2<const Index, 3> faces, Array1<const Index> facet_ids, Index n_vertices, bool is_wide) {
        return without_lock(
            [&](Stop& stop) { return duplicate_facets(rows(faces), span(facet_ids), n_vertices, is_wide, stop); });
      },
      array("faces"), array("facet_ids"), nb::arg("n_vertices"), nb::arg("is_wide") = false,
      "Count the facets that have the corners of an earlier one.");
}

}  // namespace voxkernel
