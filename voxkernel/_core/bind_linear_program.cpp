#include "bind.h"
#include "deepest_point.h"
#include "plane_passes.h"

namespace voxkernel {

void bind_linear_program(nb::module_& m) {
  m.attr("N_BINS") = kBins;
  m.def(
      "deepest_point",
      [](Array2<const double, 3> normals, Array1<const double> offsets, Array1<const Index> rows_, double box,
         Array<Index, 4> basis, Array<double, 4> multipliers, Array<double, 4> point, double tolerance,
         Index max_steps) {
        return without_lock([&](Stop& stop) {
          return deepest_point(rows(normals), span(offsets), span(rows_), box, span(basis), span(multipliers),
                               span(point), tolerance, max_steps, stop);
        });
      },
      array("normals"), array("offsets"), array("rows"), nb::arg("box"), array("basis"), array("multipliers"),
      array("point"), nb::arg("tolerance"), nb::arg("max_steps"),
      "Maximise t with n . x + t <= d over `rows`; fill basis, multipliers and (x, t); return steps, negative if "
      "lost.");
  m.def(
      "tightest_by_direction",
      [](Array2<const double, 3> normals, Array1<const double> offsets, Array1<const double> errors,
         Array<const double, 3> point, double limit, Array<Index, kBins> ids, Array<double, kBins> slacks,
         int threads) {
        const Tightest found = without_lock([&](Stop& stop) {
          return tightest_by_direction(rows(normals), span(offsets), span(errors), point.data(), limit, span(ids),
                                       span(slacks), threads, stop);
        });
        return std::make_tuple(found.smallest, found.certain, found.where);
      },
      array("normals"), array("offsets"), array("errors"), array("point"), nb::arg("limit"), array("ids"),
      array("slacks"), nb::arg("threads") = 1,
      "One pass: smallest slack, smallest certain slack, its plane; fill the tightest plane of each direction bin.");
  m.def(
      "plane_signs",
      [](Array2<const double, 3> normals, Array1<const double> offsets, Array1<const double> errors,
         Array<const double, 3> point, double slack_error) {
        return to_array(without_lock([&](Stop& stop) {
          return plane_signs(rows(normals), span(offsets), span(errors), point.data(), slack_error, stop);
        }));
      },
      array("normals"), array("offsets"), array("errors"), array("point"), nb::arg("slack_error"),
      "One pass: list the planes that a point, known up to `slack_error`, is not certainly inside of.");
}

}  // namespace voxkernel
