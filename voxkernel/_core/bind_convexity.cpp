#include "bind.h"
#include "convexity.h"
#include "coplanar.h"

namespace voxkernel {

void bind_convexity(nb::module_& m) {
  m.def(
      "halfedge_twins",
      [](Array2<const Index, 3> faces, Index n_vertices) {
        return to_array(without_lock([&](Stop& stop) { return halfedge_twins(rows(faces), n_vertices, stop); }));
      },
      array("faces"), nb::arg("n_vertices"),
      "Pair the half-edges 3 f + k of a surface; -1 where an edge does not have two faces, one each way.");
  m.def(
      "edge_convexity",
      [](Array2<const double, 3> vertices, Array2<const Index, 3> faces, Array1<const Index> twins,
         Array1<const Index> face_planes, Array2<const Index, 3> plane_corners) {
        return without_lock([&](Stop& stop) {
          return edge_convexity(rows(vertices), rows(faces), span(twins), span(face_planes), rows(plane_corners), stop);
        });
      },
      array("vertices"), array("faces"), array("twins"), array("face_planes"), array("plane_corners"),
      "Test every edge between two facets: 2 all strictly convex, 1 some flat, 0 some concave or without twin.");
  m.def(
      "coplanar_groups",
      [](Array2<const double, 3> normals, Array1<const double> offsets, Array2<const double, 3> vertices,
         Array2<const Index, 3> corners) {
        return to_array(without_lock([&](Stop& stop) {
          return coplanar_groups(rows(normals), span(offsets), rows(vertices), rows(corners), stop);
        }));
      },
      array("normals"), array("offsets"), array("vertices"), array("corners"),
      "Name for each facet the first one that is exactly coplanar with it and faces the same way.");
}

}  // namespace voxkernel
