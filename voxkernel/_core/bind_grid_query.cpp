#include <nanobind/stl/array.h>

#include "bind.h"
#include "grid_query.h"

namespace voxkernel {
namespace {

using Triple = std::array<Index, 3>;
using Row = Array1<const std::int32_t>;
using Words = Array1<const std::uint64_t>;

template <typename Voxel>
void in_table(Array2<const Voxel, 3> voxels, Triple low, Triple shape, const Row& row, const Words& words,
              Array1<bool> active) {
  without_lock(
      [&](Stop& stop) { voxels_in_table(rows(voxels), {low, shape, span(row), span(words)}, span(active), stop); });
}

template <typename Voxel>
void in_runs(Array2<const Voxel, 3> voxels, Index reach, Array1<const Index> code, Array1<const Index> last,
             Array1<const Index> row, Array2<const std::uint64_t, 8> masks, Array1<bool> active) {
  without_lock([&](Stop& stop) {
    voxels_in_runs(rows(voxels), {reach, span(code), span(last), span(row), rows(masks)}, span(active), stop);
  });
}

template <typename Voxel>
void bind_voxels(nb::module_& m) {
  m.def("voxels_in_table", &in_table<Voxel>, array("voxels"), nb::arg("low"), nb::arg("shape"), array("row"),
        array("words"), array("active"), "Say which voxels are active in a table of 8^3 blocks.");
  m.def("voxels_in_runs", &in_runs<Voxel>, array("voxels"), nb::arg("reach"), array("code"), array("last"),
        array("row"), array("masks"), array("active"), "Say which voxels are active in sorted runs of Morton codes.");
}

}  // namespace

void bind_grid_query(nb::module_& m) {
  bind_voxels<std::int64_t>(m);
  bind_voxels<std::int32_t>(m);
  m.def(
      "points_in_table",
      [](Array2<const double, 3> points, Array<const double, 3> origin, Array<const double, 3, 3> to_cells, Triple low,
         Triple shape, const Row& row, const Words& words, Array1<bool> active) {
        without_lock([&](Stop& stop) {
          points_in_table(rows(points), origin.data(), {to_cells.data(), 3}, {low, shape, span(row), span(words)},
                          span(active), stop);
        });
      },
      array("points"), array("origin"), array("to_cells"), nb::arg("low"), nb::arg("shape"), array("row"),
      array("words"), array("active"), "Say which world points lie in active voxels of a table of 8^3 blocks.");
  m.def(
      "points_in_runs",
      [](Array2<const double, 3> points, Array<const double, 3> origin, Array<const double, 3, 3> to_cells, Index reach,
         Array1<const Index> code, Array1<const Index> last, Array1<const Index> row,
         Array2<const std::uint64_t, 8> masks, Array1<bool> active) {
        without_lock([&](Stop& stop) {
          points_in_runs(rows(points), origin.data(), {to_cells.data(), 3},
                         {reach, span(code), span(last), span(row), rows(masks)}, span(active), stop);
        });
      },
      array("points"), array("origin"), array("to_cells"), nb::arg("reach"), array("code"), array("last"), array("row"),
      array("masks"), array("active"), "Say which world points lie in active voxels of sorted runs of Morton codes.");
}

}  // namespace voxkernel
