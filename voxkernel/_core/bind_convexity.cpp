#include "bind.h"
#include "convexity.h"
#include "coplanar.h"

namespace voxkernel {

void bind_convexity(nb::module_& m) {
  m.def(
      "edge_convexity",
      [](Array2<const double, 3> vertices, Array2<const Index, 3> faces, Array1<const Index> face_planes,
         Array2<const Index, 3> plane_corners, int least, int threads) {
        return without_lock([&](Stop& stop) {
          return edge_convexity(rows(vertices), rows(faces), span(face_planes), rows(plane_corners), least, threads,
                                stop);
        });
      },
      array("vertices"), array("faces"), array("face_planes"), array("plane_corners"), nb::arg("least") = 1,
      nb::arg("threads") = 1,
      "Test every edge between two facets: 2 all strictly convex, 1 some flat, 0 some concave or without two faces, "
      "or less than `least`.");
  m.def(
      "used_vertices",
      [](Array2<const double, 3> vertices, Array2<const Index, 3> faces, Array<const double, 3> origin, double scale,
         Array<const double, 3> point, int threads) {
        UsedVertices found = without_lock([&](Stop& stop) {
          return used_vertices(rows(vertices), rows(faces), origin.data(), scale, point.data(), threads, stop);
        });
        return std::make_tuple(to_rows<3>(std::move(found.vertices)), to_read_only(std::move(found.ring)));
      },
      array("vertices"), array("faces"), array("origin"), nb::arg("scale"), array("point"), nb::arg("threads") = 1,
      "Vertices in use as (vertex - origin) / scale - point, and the corners of faces as numbers of them.");
  m.def(
      "triangles_at_vertices",
      [](Array1<const std::int32_t> ring, Index n_vertices, int threads) {
        return to_read_only_rows<3>(
            without_lock([&](Stop& stop) { return triangles_at_vertices(span(ring), n_vertices, threads, stop); }));
      },
      array("ring"), nb::arg("n_vertices"), nb::arg("threads") = 1,
      "The first, a middle and the last triangle at each vertex.");
  m.def(
      "coplanar_groups",
      [](Array2<const double, 3> normals, Array2<const double, 3> vertices, Array2<const Index, 3> corners,
         Array2<const double, 4> explicit_planes, bool is_cone, int threads) {
        const InputPlanes sources{rows(vertices), rows(corners), rows(explicit_planes), is_cone};
        return to_array(
            without_lock([&](Stop& stop) { return coplanar_groups(rows(normals), sources, threads, stop); }));
      },
      array("normals"), array("vertices"), array("corners"), array("explicit_planes"), nb::arg("is_cone") = false,
      nb::arg("threads") = 1,
      "Name for each half-space the first one that is exactly coplanar with it and faces the same way.");
  m.def(
      "first_of_planes",
      [](Array2<const double, 3> normals, Array2<const double, 3> vertices, Array2<const Index, 3> corners,
         Array2<const double, 4> explicit_planes, bool is_cone, Array1<const Index> chosen) {
        const InputPlanes sources{rows(vertices), rows(corners), rows(explicit_planes), is_cone};
        return to_array(
            without_lock([&](Stop& stop) { return first_of_planes(rows(normals), sources, span(chosen), 1, stop); }));
      },
      array("normals"), array("vertices"), array("corners"), array("explicit_planes"), nb::arg("is_cone"),
      array("rows"), "Of the half-spaces of ascending rows, the first on each plane.");
}

}  // namespace voxkernel
