#include "bind.h"
#include "center.h"
#include "field.h"
#include "violation.h"

namespace voxkernel {

void bind_violation(nb::module_& m) {
  m.def(
      "least_violated",
      [](Array2<const double, 3> normals, Array1<const double> offsets, Array1<const double> errors,
         Array1<const Index> weights, Array<const double, 15> frame, Array2<const double, 3> border_normals,
         Array1<const double> border_offsets, Array1<const double> border_pads, double blur, Index best, Index gap,
         double ratio, int max_level, Index max_cells, int threads, Array<double, 3> center,
         Array<double, 4> open_cell) {
        const Least found = without_lock([&](Stop& stop) {
          return least_violated({rows(normals), span(offsets), span(errors), span(weights), CubeFrame(frame.data())},
                                {rows(border_normals), span(border_offsets), span(border_pads)}, blur, best,
                                {gap, ratio, max_level, max_cells, threads}, center.data(), open_cell.data(), stop);
        });
        return std::make_tuple(found.best, found.lower, found.n_cells, found.is_over);
      },
      array("normals"), array("offsets"), array("errors"), array("weights"), array("frame"), array("border_normals"),
      array("border_offsets"), array("border_pads"), nb::arg("blur"), nb::arg("best"), nb::arg("gap"), nb::arg("ratio"),
      nb::arg("max_level"), nb::arg("max_cells"), nb::arg("threads"), array("center"), array("open_cell"),
      "Find the least violated weight in the unit cube within `gap`, or within `ratio` of it where that is more.\n\n"
      "Planes are in a frame of their own; `frame` says how they come into the cube: nine numbers that turn normals,\n"
      "three along which offsets are moved, what offsets are scaled by, and what errors are multiplied by and then\n"
      "added to become pads. The border is that of a domain, in the cube. `best` is a weight known to be reached; "
      "when\n"
      "a centre does better, it is written to `center`. `blur` is by how much a centre may move later.\n\n"
      "Returns (best, lower, n_cells, is_over): `lower` is certain; it is further below than asked for when cells of\n"
      "`max_level` stay open, or when it is over because `max_cells` have been looked at or as many planes as these\n"
      "have with 2,048 each. `open_cell` is centre and half edge of the least violated open cell of `max_level`.\n"
      "Nothing depends on the number of threads.");
  m.def(
      "violation_cells",
      [](Array2<const double, 3> normals, Array1<const double> offsets, Array1<const double> reach,
         Array1<const Index> weights, Index n_domain, Index most, double units, int depth) {
        ViolationCells found = without_lock([&](Stop& stop) {
          return violation_cells({rows(normals), span(offsets), span(reach), {}, span(weights), n_domain}, most, units,
                                 depth, stop);
        });
        return std::make_tuple(to_rows<3>(std::move(found.tiles.ijk)), to_array(std::move(found.tiles.log2)),
                               to_array(std::move(found.tile_values)), to_rows<3>(std::move(found.leaf_ijk)),
                               to_rows<8>(std::move(found.leaf_mask)), to_rows<512>(std::move(found.leaf_values)));
      },
      array("normals"), array("offsets"), array("reach"), array("weights"), nb::arg("n_domain"), nb::arg("most"),
      nb::arg("units"), nb::arg("depth"),
      "Sample the violated weight on the unit cube, 2**depth voxels an edge, where it may be at most `most`.\n\n"
      "Returns (tile_ijk, tile_log2, tile_values, leaf_ijk, leaf_mask, leaf_values): values are weights over\n"
      "`units`; voxels are active where the centre is inside the domain planes and violates at most `most`.");
  m.def(
      "violated_weights",
      [](Array<const double, 3, -1> local, Array2<const double, 3> world, Array2<const double, 3> normals,
         Array1<const double> offsets, Array1<const double> errors, Array1<const Index> weights,
         Array2<const Index, 3> corners, Array2<const double, 3> vertices, bool by_expansions, Array1<Index> order,
         Array1<Index> sums, StopFlag* flag) {
        std::vector<Index> open_pairs = without_lock(
            [&](Stop& stop) {
              const Index n = static_cast<Index>(local.shape(1));
              const double* x = local.data();
              return violated_weights(
                  {{{x, n}, {x + n, n}, {x + 2 * n, n}}, rows(world)},
                  {rows(normals), span(offsets), span(errors), span(weights), rows(corners), rows(vertices)},
                  by_expansions, span(order), span(sums), stop);
            },
            flag);
        return to_rows<2>(std::move(open_pairs));
      },
      array("local"), array("world"), array("normals"), array("offsets"), array("errors"), array("weights"),
      array("corners"), array("vertices"), nb::arg("by_expansions"), array("order"), array("sums"), stop_argument(),
      "Fill sums[i] with the weight that point i violates, for the points of `order` (which is reordered).\n\n"
      "`local` are columns (3, n), `world` the same points as given, (n, 3). `errors[i]` bounds the error of\n"
      "n . x - d over |x| + 1. Planes without corners, and all with `by_expansions` false, are left to exact\n"
      "arithmetic elsewhere: returns the pairs (point, plane) whose sign is open.");
  m.def(
      "faces_away",
      [](Array2<const double, 3> vertices, Array2<const Index, 3> faces, Array<const double, 3> point) {
        const std::size_t n = faces.shape(0);
        std::unique_ptr<bool[]> away(new bool[n]);
        without_lock([&](Stop& stop) {
          faces_away(rows(vertices), rows(faces), point.data(), {away.get(), static_cast<Index>(n)}, stop);
        });
        nb::capsule owner(away.get(), [](void* p) noexcept { delete[] static_cast<bool*>(p); });
        return Array1<bool>(away.release(), {n}, owner);
      },
      array("vertices"), array("faces"), array("point"),
      "Tell for every triangle whether the point is strictly on its outer side; every sign exact.");
}

}  // namespace voxkernel
