#include "bind.h"
#include "feasibility.h"

namespace voxkernel {

void bind_feasibility(nb::module_& m) {
  m.def(
      "find_deep_point",
      [](Array2<const double, 3> normals, Array1<const double> offsets, Array1<const double> errors) {
        DeepPoint found =
            without_lock([&](Stop& stop) { return find_deep_point(rows(normals), span(offsets), span(errors), stop); });
        return std::make_tuple(to_read_only(std::move(found.rows)), to_read_only(std::move(found.opposing)), found.gap,
                               found.depth, to_read_only(std::vector<double>(found.point, found.point + 3)),
                               to_read_only(std::move(found.nearest)), found.passes);
      },
      array("normals"), array("offsets"), array("errors"),
      "Look for a deep point on a growing working set: (rows, opposing, gap, depth, point, nearest, passes).");
}

}  // namespace voxkernel
