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
      "coordinate_range",
      [](Array2<const double, 3> vertices, Array2<const Index, 3> faces) {
        const Box box = without_lock([&](Stop& stop) { return coordinate_range(rows(vertices), rows(faces), stop); });
        return std::make_tuple(to_array(std::vector<double>(box.low, box.low + 3)),
                               to_array(std::vector<double>(box.high, box.high + 3)), box.smallest);
      },
      array("vertices"), array("faces"),
      "Of the vertices in use: lower and upper corner of the bounding box, and the smallest magnitude but zero.");
  m.def(
      "boundary_is_zero",
      [](Array2<const Index, 3> faces, Index n_vertices, int threads) {
        return without_lock([&](Stop& stop) { return boundary_is_zero(rows(faces), n_vertices, threads, stop); });
      },
      array("faces"), nb::arg("n_vertices"), nb::arg("threads") = 1,
      "Whether every edge is traversed equally often in both directions: the surface bounds a volume.");
}

}  // namespace voxkernel
