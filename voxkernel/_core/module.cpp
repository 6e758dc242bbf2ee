// The module voxkernel._core; each group of functions is bound in its own file.
#include <stdexcept>
#include <string>

#include "bind.h"
#include "self_test.h"

namespace voxkernel {

void bind_cells(nb::module_& m);
void bind_convexity(nb::module_& m);
void bind_dual_hull(nb::module_& m);
void bind_feasibility(nb::module_& m);
void bind_grid_query(nb::module_& m);
void bind_guards(nb::module_& m);
void bind_labels(nb::module_& m);
void bind_linear_program(nb::module_& m);
void bind_mesh(nb::module_& m);
void bind_octree(nb::module_& m);
void bind_planes(nb::module_& m);
void bind_polyhedron(nb::module_& m);
void bind_predicates(nb::module_& m);
void bind_reading(nb::module_& m);
void bind_sphere(nb::module_& m);
void bind_violation(nb::module_& m);

}  // namespace voxkernel

NB_MODULE(_core, m) {
  using namespace voxkernel;
  if (const char* fault = arithmetic_fault()) {
    const std::string text = std::string("voxkernel._core was built by a compiler that breaks exact arithmetic (") +
                             fault + "); build it without fast-math and contraction";
    throw std::runtime_error(text);  // becomes ImportError
  }
  m.doc() = "The compiled core: plain arrays in and out, one function per algorithm.";
  nb::class_<StopFlag>(m, "StopFlag", "Tells loops that run in other threads to stop.")
      .def(nb::init<>())
      .def("set", [](StopFlag& flag) { flag.is_set.store(true); }, "Ask them to stop.");
  bind_cells(m);
  bind_convexity(m);
  bind_dual_hull(m);
  bind_feasibility(m);
  bind_grid_query(m);
  bind_guards(m);
  bind_labels(m);
  bind_linear_program(m);
  bind_mesh(m);
  bind_octree(m);
  bind_planes(m);
  bind_polyhedron(m);
  bind_predicates(m);
  bind_reading(m);
  bind_sphere(m);
  bind_violation(m);
}
