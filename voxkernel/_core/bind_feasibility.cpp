#include "bind.h"
#include "feasibility.h"

namespace voxkernel {
namespace {

auto to_tuple(DeepPoint&& found) {
  return std::make_tuple(to_read_only(std::move(found.rows)), to_read_only(std::move(found.opposing)), found.gap,
                         found.depth, to_read_only(std::vector<double>(found.point, found.point + 3)),
                         to_read_only(std::move(found.nearest)), found.passes);
}

}  // namespace

void bind_feasibility(nb::module_& m) {
  m.def(
      "find_deep_point",
      [](Array2<const double, 3> normals, Array1<const double> offsets, Array1<const double> errors, int threads) {
        return to_tuple(without_lock(
            [&](Stop& stop) { return find_deep_point(rows(normals), span(offsets), span(errors), threads, stop); }));
      },
      array("normals"), array("offsets"), array("errors"), nb::arg("threads") = 1,
      "Look for a deep point on a growing working set: (rows, opposing, gap, depth, point, nearest, passes).");
  nb::class_<DeepPointSearch>(m, "DeepPointSearch",
                              "The steps of `find_deep_point`, for half-spaces that are gone over elsewhere.")
      .def(nb::init<>())
      .def_static(
          "first_rows", [](Index n) { return to_array(DeepPointSearch::first_rows(n)); }, nb::arg("n"),
          "The half-spaces to begin with: all of few, an even sample of many.")
      .def(
          "add",
          [](DeepPointSearch& search, Array1<const Index> numbers, Array2<const double, 3> normals,
             Array1<const double> offsets) { search.add(span(numbers), rows(normals), span(offsets)); },
          array("rows"), array("normals"), array("offsets"), "Take half-spaces into the working set.")
      .def(
          "propose",
          [](DeepPointSearch& search) { return without_lock([&](Stop& stop) { return search.propose(stop); }); },
          "Whether there is a point at which all half-spaces are to be looked at.")
      .def(
          "point",
          [](const DeepPointSearch& search) {
            return to_read_only(std::vector<double>(search.point(), search.point() + 3));
          },
          "The point.")
      .def_prop_ro("upper", &DeepPointSearch::upper, "Half-spaces with a slack of less there are tighter than the set.")
      .def(
          "fresh",
          [](const DeepPointSearch& search, Array1<const Index> ids) { return to_array(search.fresh(span(ids))); },
          array("ids"), "Of half-spaces that are tighter, those that are new, ascending; -1 is none.")
      .def("judge", &DeepPointSearch::judge, nb::arg("smallest"), nb::arg("certain"), nb::arg("is_any_new"),
           "Whether to go on, after what a pass found: smallest slack, smallest one less its error.")
      .def(
          "result", [](const DeepPointSearch& search) { return to_tuple(search.result()); },
          "As of `find_deep_point`.");
}

}  // namespace voxkernel
