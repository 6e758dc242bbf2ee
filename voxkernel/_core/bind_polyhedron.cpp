#include "bind.h"
#include "clipping.h"
#include "polyhedron.h"
#include "reach.h"

namespace voxkernel {

void bind_polyhedron(nb::module_& m) {
  m.def(
      "clipped_polyhedron",
      [](Array2<const double, 3> normals, Array1<const double> slacks, double reach) {
        Clipped found =
            without_lock([&](Stop& stop) { return clipped_polyhedron(rows(normals), span(slacks), reach, stop); });
        return std::make_tuple(to_rows<3>(std::move(found.vertices)), to_array(std::move(found.start)),
                               to_array(std::move(found.ring)), to_array(std::move(found.rows)), found.is_closed,
                               found.is_sound);
      },
      array("normals"), array("slacks"), nb::arg("reach"),
      "Cut a cube about the origin by a few planes: vertices, starts and rings of faces, their rows, whether no face "
      "of the cube is left, and whether the faces close.");
  m.def(
      "moments",
      [](Array2<const double, 3> vertices, Array1<const Index> start, Array1<const Index> ring) {
        const Moments found =
            without_lock([&](Stop& stop) { return moments(rows(vertices), span(start), span(ring), stop); });
        return std::make_tuple(found.volume, to_array(std::vector<double>(found.first, found.first + 3)),
                               to_rows<3>(std::vector<double>(&found.second[0][0], &found.second[0][0] + 9)),
                               found.area);
      },
      array("vertices"), array("start"), array("ring"),
      "Volume, first and second moments about the origin, area, of polygons seen from the origin inside.");
  m.def(
      "face_misfit",
      [](Array2<const double, 3> normals, Array1<const double> offsets, Array1<const double> errors,
         Array<const double, 3> center, Array2<const double, 3> vertices, Array1<const Index> start,
         Array1<const Index> ring, Array1<const Index> rows_) {
        const Misfit misfit = without_lock([&](Stop&) {
          return face_misfit(rows(normals), span(offsets), span(errors), center.data(), rows(vertices), span(start),
                             span(ring), span(rows_));
        });
        return std::make_tuple(misfit.on_face, misfit.blur, misfit.extent);
      },
      array("normals"), array("offsets"), array("errors"), array("center"), array("vertices"), array("start"),
      array("ring"), array("rows"),
      "Largest distance of a corner from the plane of its face, a bound on its rounding, and the farthest corner.");
  m.def(
      "solid_angle",
      [](Array2<const double, 3> vertices, Array1<const Index> ring) {
        return without_lock([&](Stop& stop) { return solid_angle(rows(vertices), span(ring), stop); });
      },
      array("vertices"), array("ring"), "Signed solid angle of triangles seen from the origin.");
  m.def(
      "planes_reaching",
      [](Array2<const double, 3> normals, Array1<const double> offsets, Array1<const double> errors,
         Array<const double, 3> center, Array2<const double, 3> corners, double margin) {
        Reach reach = without_lock([&](Stop& stop) {
          return planes_reaching(rows(normals), span(offsets), span(errors), center.data(), rows(corners), margin,
                                 stop);
        });
        return std::make_tuple(to_array(std::move(reach.rows)), to_array(std::move(reach.excess)),
                               to_array(std::move(reach.pads)));
      },
      array("normals"), array("offsets"), array("errors"), array("center"), array("corners"), nb::arg("margin"),
      "List the planes not clear of corners about a centre by a margin, how far the corners pass each, and "
      "rounding.");
}

}  // namespace voxkernel
