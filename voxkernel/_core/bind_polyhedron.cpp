#include "bind.h"
#include "polyhedron.h"
#include "reach.h"

namespace voxkernel {

void bind_polyhedron(nb::module_& m) {
  m.def(
      "moments",
      [](Array2<const double, 3> vertices, Array1<const Index> start, Array1<const std::int32_t> ring, int threads) {
        const Moments found =
            without_lock([&](Stop& stop) { return moments(rows(vertices), span(start), span(ring), threads, stop); });
        return std::make_tuple(found.volume, to_array(std::vector<double>(found.first, found.first + 3)),
                               to_rows<3>(std::vector<double>(&found.second[0][0], &found.second[0][0] + 9)),
                               found.area);
      },
      array("vertices"), array("start"), array("ring"), nb::arg("threads") = 1,
      "Volume, first and second moments about the origin, area, of polygons seen from the origin inside.");
  m.def(
      "solid_angle",
      [](Array2<const double, 3> vertices, Array1<const std::int32_t> ring, int threads) {
        return without_lock([&](Stop& stop) { return solid_angle(rows(vertices), span(ring), threads, stop); });
      },
      array("vertices"), array("ring"), nb::arg("threads") = 1,
      "Signed solid angle of triangles seen from the origin.");
  m.def(
      "planes_reaching",
      [](Array2<const double, 3> normals, Array1<const double> offsets, Array1<const double> errors,
         Array<const double, 3> center, Array2<const double, 3> corners, double margin, Array1<const bool> among,
         int threads) {
        return to_array(without_lock([&](Stop& stop) {
          return planes_reaching(rows(normals), span(offsets), span(errors), center.data(), rows(corners), margin,
                                 span(among), threads, stop);
        }));
      },
      array("normals"), array("offsets"), array("errors"), array("center"), array("corners"), nb::arg("margin"),
      array("among"), nb::arg("threads") = 1,
      "List the planes, of all or of those where `among` is true, not clear of corners about a centre by a margin.");
}

}  // namespace voxkernel
