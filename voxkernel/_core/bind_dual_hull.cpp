#include "bind.h"
#include "dual_hull.h"
#include "solid_measures.h"

namespace voxkernel {

void bind_dual_hull(nb::module_& m) {
  m.def(
      "dual_hull",
      [](Array2<const double, 3> normals, Array1<const double> offsets, Array1<const double> errors,
         Array<const double, 3> local_center, double center_error, double scale, Array2<const double, 3> vertices,
         Array2<const Index, 3> corners, Array2<const double, 4> given, Array2<const double, 3> center,
         Array1<const Index> chosen, int cube_exponent, int threads) {
        HullPolytope found = without_lock([&](Stop& stop) {
          const LocalPlanes planes{rows(normals),       span(offsets), span(errors),
                                   local_center.data(), center_error,  scale};
          const PlaneSource source{rows(vertices), rows(corners), rows(given), rows(center)};
          return dual_hull(planes, source, span(chosen), cube_exponent, threads, stop);
        });
        return std::make_tuple(found.is_inside, found.is_closed, to_rows<3>(std::move(found.vertices)),
                               to_rows<3>(std::move(found.vertex_rows)), found.vertex_error,
                               to_array(std::move(found.start)), to_array(std::move(found.ring)),
                               to_array(std::move(found.rows)));
      },
      array("normals"), array("offsets"), array("errors"), array("local_center"), nb::arg("center_error"),
      nb::arg("scale"), array("vertices"), array("corners"), array("given"), array("center"), array("rows"),
      nb::arg("cube_exponent"), nb::arg("threads") = 1,
      "The polytope of half-spaces about a point strictly inside: whether the point is, whether no side of a cube is "
      "left, vertices from the point, three rows of each, a bound on their errors, starts and rings of faces, and "
      "their rows.");
  m.def(
      "solid_measures",
      [](Array2<const double, 3> normals, Array1<const double> offsets, Array<const double, 3> center,
         Array2<const double, 3> vertices, Array1<const Index> start, Array1<const Index> ring,
         Array1<const Index> rows_) {
        const SolidMeasures found = without_lock([&](Stop& stop) {
          return solid_measures(rows(normals), span(offsets), center.data(), rows(vertices), span(start), span(ring),
                                span(rows_), stop);
        });
        return std::make_tuple(found.extent, found.volume, found.area,
                               to_array(std::vector<double>(found.centroid, found.centroid + 3)),
                               to_rows<3>(std::vector<double>(found.inertia, found.inertia + 9)),
                               to_array(std::vector<double>(found.deepest, found.deepest + 3)), found.clearance);
      },
      array("normals"), array("offsets"), array("center"), array("vertices"), array("start"), array("ring"),
      array("rows"),
      "Extent, volume, area, centroid and second central moment of a convex polyhedron about `center`, the centre of "
      "a largest ball in it and its radius.");
}

}  // namespace voxkernel
