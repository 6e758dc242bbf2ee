#include "bind.h"
#include "predicates.h"

namespace voxkernel {

namespace {

using Quadruples = Array<const double, -1, 4, 3>;

// One number for each four points.
template <typename Predicate>
Array1<double> each_of(const Quadruples& points, Predicate predicate) {
  const auto n = static_cast<Index>(points.shape(0));
  std::vector<double> signs(n);
  without_lock([&](Stop& stop) {
    for (Index i = 0; i < n; ++i) {
      stop.poll();
      const double* p = points.data() + 12 * i;
      signs[i] = predicate(p, p + 3, p + 6, p + 9);
    }
  });
  return to_array(std::move(signs));
}

}  // namespace

void bind_predicates(nb::module_& m) {
  m.def(
      "orientations", [](Quadruples points) { return each_of(points, orientation); }, array("points"),
      "A number of the sign of ((b - a) x (c - a)) . (d - a) for each four points a, b, c, d.");
  m.def(
      "orient3d_exact", [](Quadruples points) { return each_of(points, orient3d_exact); }, array("points"),
      "The sign of the determinant of (a - d, b - d, c - d) for each four points a, b, c, d, without a filter.");
}

}  // namespace voxkernel
