#include "bind.h"
#include "certified_sight.h"
#include "clearances.h"
#include "cover_search.h"
#include "sight_rays.h"
#include "sight_tree.h"
#include "unseen_cells.h"

namespace voxkernel {
namespace {

using Words = Array1<std::uint64_t>;
using ConstWords = Array1<const std::uint64_t>;
using Point = Array<const double, 3>;

}  // namespace

void bind_guards(nb::module_& m) {
  nb::class_<SightTree>(m, "SightTree", "Triangles in a tree of boxes; holds a copy of their corners.")
      .def(
          "__init__",
          [](SightTree* tree, Array2<const double, 3> vertices, Array2<const Index, 3> faces) {
            without_lock([&](Stop& stop) { new (tree) SightTree(rows(vertices), rows(faces), stop); });
          },
          array("vertices"), array("faces"));
  m.def(
      "points_see",
      [](const SightTree& tree, Array2<const double, 3> points, Array2<const double, 3> spots,
         Array1<const Index> spot_faces, Words words, StopFlag* stop) {
        without_lock([&](Stop& s) { points_see(tree, rows(points), rows(spots), span(spot_faces), span(words), s); },
                     stop);
      },
      nb::arg("tree"), array("points"), array("spots"), array("spot_faces"), array("words"), stop_argument(),
      "Set the bits of the spots that each point sees, rows of 64-bit words.");
  m.def(
      "pairs_see",
      [](const SightTree& tree, Array2<const double, 3> points, Array2<const double, 3> spots,
         Array1<const Index> spot_faces, Array1<bool> seen, StopFlag* stop) {
        without_lock([&](Stop& s) { pairs_see(tree, rows(points), rows(spots), span(spot_faces), span(seen), s); },
                     stop);
      },
      nb::arg("tree"), array("points"), array("spots"), array("spot_faces"), array("seen"), stop_argument(),
      "Fill whether each point sees the spot of the same number.");
  m.def(
      "first_hits",
      [](const SightTree& tree, Array2<const double, 3> starts, Array2<const double, 3> directions,
         Array1<const Index> skip, Array1<double> at) {
        without_lock([&](Stop& s) { first_hits(tree, rows(starts), rows(directions), span(skip), span(at), s); });
      },
      nb::arg("tree"), array("starts"), array("directions"), array("skip"), array("at"),
      "Fill how many lengths of its direction each ray goes to the first triangle other than one.");
  m.def(
      "winding_numbers",
      [](const SightTree& tree, Array2<const double, 3> points, Array1<Index> windings) {
        without_lock([&](Stop& s) { winding_numbers(tree, rows(points), span(windings), s); });
      },
      nb::arg("tree"), array("points"), array("windings"), "Fill how often the surface goes around each point.");
  m.def(
      "nearest_points",
      [](const SightTree& tree, Array2<const double, 3> points, Array2<double, 3> nearest, Array1<double> distances,
         StopFlag* stop) {
        without_lock([&](Stop& s) { nearest_points(tree, rows(points), rows(nearest), span(distances), s); }, stop);
      },
      nb::arg("tree"), array("points"), array("nearest"), array("distances"), stop_argument(),
      "Fill the nearest point of the triangles, and its distance.");
  m.def(
      "clearances",
      [](const SightTree& tree, Array2<const double, 3> points, Array1<double> distances, StopFlag* stop) {
        without_lock([&](Stop& s) { clearances(tree, rows(points), span(distances), s); }, stop);
      },
      nb::arg("tree"), array("points"), array("distances"), stop_argument(),
      "Fill a bound from below on the distance of each point from the triangles.");
  m.def(
      "certify_sight",
      [](const SightTree& tree, Array2<const double, 3> points, Array1<const Index> faces, Array1<const Index> order,
         Array1<const Index> max_depths, StopFlag* stop) {
        CertifiedParts found = without_lock(
            [&](Stop& s) { return certify_sight(tree, rows(points), span(faces), span(order), span(max_depths), s); },
            stop);
        return std::make_tuple(to_array(std::move(found.faces)), to_array(std::move(found.points)),
                               to_array(std::move(found.depths)), to_rows<9>(std::move(found.weights)),
                               to_rows<9>(std::move(found.corners)));
      },
      nb::arg("tree"), array("points"), array("faces"), array("order"), array("max_depths"), stop_argument(),
      "Parts of facets that a point sees as a whole: facet, point, depth, weights and rounded corners of each.");
  m.def(
      "cover_gains",
      [](ConstWords sets, Index n_words, ConstWords left, Array1<Index> gains) {
        without_lock([&](Stop& s) { cover_gains(span(sets), n_words, span(left), span(gains), s); });
      },
      array("sets"), nb::arg("n_words"), array("left"), array("gains"),
      "Fill the number of bits of each set that are left.");
  m.def(
      "maximal_sets",
      [](ConstWords sets, Index n_words) {
        return to_array(without_lock([&](Stop& s) { return maximal_sets(span(sets), n_words, s); }));
      },
      array("sets"), nb::arg("n_words"), "Rows of sets that are within no other one, the largest first.");
  m.def(
      "find_cover",
      [](ConstWords sets, Index n_words, Index count, Index need, Index max_steps) {
        return to_array(
            without_lock([&](Stop& s) { return find_cover(span(sets), n_words, count, need, max_steps, s); }));
      },
      array("sets"), nb::arg("n_words"), nb::arg("count"), nb::arg("need"), nb::arg("max_steps"),
      "At most `count` sets with `need` bits; empty where there are none, [-1] where that is open.");
  m.def(
      "cells_may_see",
      [](Array<const double, -1, -1, -1> distances, const Point& low, double step, Array2<const double, 3> centers,
         Array1<const double> halves, Array1<const Index> parents, Array1<const bool> before,
         Array2<const double, 3> spots, Array2<const double, 3> normals, double slack, Array1<bool> may_see,
         StopFlag* stop) {
        OutsideGrid grid{distances.data(), {}, {}, step};
        for (int k = 0; k < 3; ++k) {
          grid.shape[k] = static_cast<Index>(distances.shape(k));
          grid.low[k] = low.data()[k];
        }
        without_lock(
            [&](Stop& s) {
              cells_may_see(grid, rows(centers), span(halves), span(parents), span(before), rows(spots), rows(normals),
                            slack, span(may_see), s);
            },
            stop);
      },
      array("distances"), array("low"), nb::arg("step"), array("centers"), array("halves"), array("parents"),
      array("before"), array("spots"), array("normals"), nb::arg("slack"), array("may_see"), stop_argument(),
      "Fill whether a cell may hold a point that sees a spot.");
}

}  // namespace voxkernel
