#include "bind.h"
#include "cell_planes.h"
#include "cell_sides.h"
#include "cells.h"

namespace voxkernel {

void bind_cells(nb::module_& m) {
  m.def(
      "solve_cells",
      [](Array2<const double, 3> vertices, Array1<const Index> face_offsets, Array1<const Index> face_vertices,
         Array1<const Index> cell_offsets, Array1<const Index> cell_faces, Array1<const bool> cell_flips, Index first,
         Index last, double rtol, Array1<Index> outcome, Array2<double, 4> numbers, Array2<double, 3> center,
         Array2<Index, 4> witness, StopFlag* flag) {
        const CellMesh mesh{rows(vertices), span(face_offsets), span(face_vertices), span(cell_offsets),
                            span(cell_faces)};
        const CellAnswers answers{span(outcome), rows(numbers), rows(center), rows(witness)};
        without_lock([&](Stop& stop) { solve_cells(mesh, span(cell_flips), first, last, rtol, answers, stop); }, flag);
      },
      array("vertices"), array("face_offsets"), array("face_vertices"), array("cell_offsets"), array("cell_faces"),
      array("cell_flips"), nb::arg("first"), nb::arg("last"), nb::arg("rtol"), array("outcome"), array("numbers"),
      array("center"), array("witness"), stop_argument(),
      "Solve the cells first .. last - 1; fill outcome, numbers (volume, diameter, kernel volume, inradius), center "
      "and witness.");
  m.def(
      "orient_cells",
      [](Array2<const double, 3> vertices, Array1<const Index> face_offsets, Array1<const Index> face_vertices,
         Array1<const Index> cell_offsets, Array1<const Index> cell_faces, Array1<bool> cell_flips,
         Array1<Index> answer) {
        const CellMesh mesh{rows(vertices), span(face_offsets), span(face_vertices), span(cell_offsets),
                            span(cell_faces)};
        without_lock([&](Stop& stop) { orient_cells(mesh, span(cell_flips), span(answer), stop); });
      },
      array("vertices"), array("face_offsets"), array("face_vertices"), array("cell_offsets"), array("cell_faces"),
      array("cell_flips"), array("answer"),
      "Turn the faces of each cell alike, then outward; say in `answer` how that went.");
  m.def(
      "squared_diameter",
      [](Array2<const double, 3> points) {
        return without_lock([&](Stop& stop) { return squared_diameter(rows(points), stop); });
      },
      array("points"), "Largest squared distance of two points.");
}

}  // namespace voxkernel
