#include "bind.h"
#include "dual_hull.h"

namespace voxkernel {

void bind_dual_hull(nb::module_& m) {
  m.def(
      "dual_hull",
      [](Array2<const double, 3> normals, Array1<const double> offsets, Array1<const double> errors,
         Array<const double, 3> local_center, double center_error, double scale, Array2<const double, 3> vertices,
         Array2<const Index, 3> corners, Array2<const double, 4> given, Array2<const double, 3> center,
         Array1<const Index> chosen, int cube_exponent) {
        HullPolytope found = without_lock([&](Stop& stop) {
          const LocalPlanes planes{rows(normals),       span(offsets), span(errors),
                                   local_center.data(), center_error,  scale};
          const PlaneSource source{rows(vertices), rows(corners), rows(given), rows(center)};
          return dual_hull(planes, source, span(chosen), cube_exponent, stop);
        });
        return std::make_tuple(found.is_inside, found.is_closed, to_rows<3>(std::move(found.vertices)),
                               to_rows<3>(std::move(found.vertex_rows)), found.vertex_error,
                               to_array(std::move(found.start)), to_array(std::move(found.ring)),
                               to_array(std::move(found.rows)), found.n_decided);
      },
      array("normals"), array("offsets"), array("errors"), array("local_center"), nb::arg("center_error"),
      nb::arg("scale"), array("vertices"), array("corners"), array("given"), array("center"), array("rows"),
      nb::arg("cube_exponent"),
      "The polytope of half-spaces about a point strictly inside: whether the point is, whether no side of a cube is "
      "left, vertices from the point, three rows of each, a bound on their errors, starts and rings of faces, their "
      "rows, and the number of signs decided in integers.");
}

}  // namespace voxkernel
