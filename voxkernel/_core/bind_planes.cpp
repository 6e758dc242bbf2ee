#include "bind.h"
#include "planes.h"

namespace voxkernel {

void bind_planes(nb::module_& m) {
  m.def(
      "facet_planes",
      [](Array2<const double, 3> vertices, Array2<const Index, 3> corners, Array<const double, 3> origin,
         double inverse_scale, Array2<double, 3> normals, Array1<double> offsets, Array1<double> areas,
         Array1<double> errors) {
        return without_lock([&](Stop& stop) {
          return facet_planes(rows(vertices), rows(corners), origin.data(), inverse_scale, rows(normals), span(offsets),
                              span(areas), span(errors), stop);
        });
      },
      array("vertices"), array("corners"), array("origin"), nb::arg("inverse_scale"), array("normals"),
      array("offsets"), array("areas"), array("errors"),
      "Fill unit normals, offsets, areas and error bounds of facet planes; return how many are undecided.");
  m.def(
      "mesh_planes",
      [](Array2<const double, 3> vertices, Array2<const Index, 3> faces, Array2<const Index, 3> corners, int threads) {
        MeshPlanes found = without_lock(
            [&](Stop& stop) { return mesh_planes(rows(vertices), rows(faces), rows(corners), threads, stop); });
        const PlaneFrame& frame = found.frame;
        return std::make_tuple(to_read_only(std::vector<double>(frame.origin, frame.origin + 3)), frame.scale,
                               std::make_tuple(frame.span[0], frame.span[1], frame.span[2]), frame.largest,
                               frame.smallest, to_rows<3>(std::move(found.normals)), to_array(std::move(found.offsets)),
                               to_array(std::move(found.areas)), to_array(std::move(found.errors)), found.undecided,
                               found.refused, found.bounds_volume);
      },
      array("vertices"), array("faces"), array("corners"), nb::arg("threads") = 1,
      "The planes of a mesh: origin, scale, spans along the axes, the largest magnitude and the smallest but zero; "
      "unit "
      "normals, offsets, areas, error bounds; how many are undecided, how many of them and without area; whether every "
      "edge of `faces` is traversed equally often in both directions.");
  m.def(
      "coordinate_range",
      [](Array2<const double, 3> vertices, Array2<const Index, 3> faces, int threads) {
        const Box box =
            without_lock([&](Stop& stop) { return coordinate_range(rows(vertices), rows(faces), threads, stop); });
        return std::make_tuple(to_array(std::vector<double>(box.low, box.low + 3)),
                               to_array(std::vector<double>(box.high, box.high + 3)), box.smallest);
      },
      array("vertices"), array("faces"), nb::arg("threads") = 1,
      "Of the vertices in use: lower and upper corner of the bounding box, and the smallest magnitude but zero.");
  m.def(
      "plane_frame",
      [](Array2<const double, 3> vertices, Array2<const Index, 3> faces) {
        const PlaneFrame found =
            without_lock([&](Stop& stop) { return plane_frame(rows(vertices), rows(faces), stop); });
        return std::make_tuple(to_read_only(std::vector<double>(found.origin, found.origin + 3)), found.scale,
                               std::make_tuple(found.span[0], found.span[1], found.span[2]), found.largest,
                               found.smallest);
      },
      array("vertices"), array("faces"),
      "The local frame of the vertices in use: origin, scale, spans along the axes, the largest magnitude and the "
      "smallest but zero.");
  m.def(
      "least_spread",
      [](Array2<const double, 3> normals, Index step) {
        return without_lock([&](Stop& stop) { return least_spread(rows(normals), step, stop); });
      },
      array("normals"), nb::arg("step"),
      "A lower bound of the mean square of unit normals along any direction, of every `step`-th, up to rounding.");
  m.def(
      "boundary_is_zero",
      [](Array2<const Index, 3> faces, Index n_vertices, int threads) {
        return without_lock([&](Stop& stop) { return boundary_is_zero(rows(faces), n_vertices, threads, stop); });
      },
      array("faces"), nb::arg("n_vertices"), nb::arg("threads") = 1,
      "Whether every edge is traversed equally often in both directions: the surface bounds a volume.");
}

}  // namespace voxkernel
