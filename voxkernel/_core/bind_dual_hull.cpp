#include <algorithm>

#include "bind.h"
#include "coplanar.h"
#include "dual_hull.h"
#include "solid_measures.h"

namespace voxkernel {

void bind_dual_hull(nb::module_& m) {
  m.def(
      "dual_hull",
      [](Array2<const double, 3> normals, Array1<const double> offsets, Array1<const double> errors,
         Array<const double, 3> local_center, double center_error, double scale, Array2<const double, 3> vertices,
         Array2<const Index, 3> corners, Array2<const double, 4> given, Array2<const double, 3> center, bool is_cone,
         Array1<const Index> chosen, int cube_exponent, int threads) {
        HullPolytope found = without_lock([&](Stop& stop) {
          const LocalPlanes planes{rows(normals),       span(offsets), span(errors),
                                   local_center.data(), center_error,  scale};
          const PlaneSource source{rows(vertices), rows(corners), rows(given), rows(center)};
          const InputPlanes sources{source.vertices, source.corners, source.given, is_cone};
          std::vector<Index> first = first_of_planes(planes.normals, sources, span(chosen), threads, stop);
          return dual_hull(planes, source, std::move(first), cube_exponent, threads, stop);
        });
        return std::make_tuple(found.is_inside, found.is_closed, to_rows<3>(std::move(found.vertices)),
                               to_read_only_rows<3>(std::move(found.vertex_rows)), found.vertex_error,
                               to_read_only(std::move(found.start)), to_read_only(std::move(found.ring)),
                               to_read_only(std::move(found.rows)));
      },
      array("normals"), array("offsets"), array("errors"), array("local_center"), nb::arg("center_error"),
      nb::arg("scale"), array("vertices"), array("corners"), array("given"), array("center"), nb::arg("is_cone"),
      array("rows"), nb::arg("cube_exponent"), nb::arg("threads") = 1,
      "The polytope of half-spaces, of ascending rows, about a point strictly inside: whether the point is, whether no "
      "side of a cube is left, vertices from the point, three rows of each, a bound on their errors, starts and rings "
      "of faces, and their rows (the first on each plane).");
  m.def(
      "solid_measures",
      [](Array2<const double, 3> normals, Array1<const double> offsets, Array<const double, 3> center,
         Array2<double, 3> vertices, Array1<const Index> start, Array1<const std::int32_t> ring,
         Array1<const std::int32_t> rows_, double proven, Array<const double, 3> origin, double scale, int threads) {
        const auto to_world = [&](double* points, Index n) {
          for (Index i = 0; i < 3 * n; ++i) points[i] = (center(i % 3) + points[i]) * scale + origin(i % 3);
        };
        SolidMeasures found = without_lock([&](Stop& stop) {
          SolidMeasures local = solid_measures(rows(normals), span(offsets), center.data(), rows(vertices), span(start),
                                               span(ring), span(rows_), threads, stop);
          to_world(vertices.data(), rows(vertices).size());
          return local;
        });
        if (found.clearance < proven) {
          std::fill_n(found.deepest, 3, 0.0);
          found.clearance = proven;
        }
        to_world(found.centroid, 1);
        to_world(found.deepest, 1);
        for (double& value : found.inertia) value *= scale * scale * scale * scale * scale;
        return std::make_tuple(found.extent, found.volume, found.area, found.clearance,
                               to_read_only(std::vector<double>(found.centroid, found.centroid + 3)),
                               to_read_only(std::vector<double>(found.deepest, found.deepest + 3)),
                               to_read_only_rows<3>(std::vector<double>(found.inertia, found.inertia + 9)));
      },
      array("normals"), array("offsets"), array("center"), array("vertices"), array("start"), array("ring"),
      array("rows"), nb::arg("proven"), array("origin"), nb::arg("scale"), nb::arg("threads") = 1,
      "Of a convex polyhedron about `center`, which is `proven` deep: extent, volume, area, and radius of a largest "
      "ball in it, in local units; in the world its centroid, the centre of that ball and the second central moment. "
      "Moves the vertices to the world.");
}

}  // namespace voxkernel
