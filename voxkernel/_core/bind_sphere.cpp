#include "bind.h"
#include "sphere_angles.h"
#include "sphere_rays.h"
#include "sphere_region.h"

namespace voxkernel {
namespace {

using Point = Array<const double, 3>;
using OutPoint = Array<double, 3>;

}  // namespace

void bind_sphere(nb::module_& m) {
  m.def(
      "triangle_angles",
      [](Array2<const double, 3> vertices, Array2<const Index, 3> faces, Point center, Array1<const std::int8_t> side,
         Array1<double> angles) {
        const AngleSums sums = without_lock([&](Stop& stop) {
          return triangle_angles(rows(vertices), rows(faces), center.data(), span(side), span(angles), stop);
        });
        return std::make_tuple(sums.total, sums.size);
      },
      array("vertices"), array("faces"), array("center"), array("side"), array("angles"),
      "Fill the signed solid angle of each triangle; return their sum and that of their sizes.");
  m.def(
      "cone_angle",
      [](Array2<const double, 3> starts, Array2<const double, 3> ends, Point apex, Point x) {
        return without_lock(
            [&](Stop& stop) { return cone_angle(rows(starts), rows(ends), apex.data(), x.data(), stop); });
      },
      array("starts"), array("ends"), array("apex"), array("x"),
      "Solid angle, modulo 4 pi, of a surface with these boundary edges.");
  m.def(
      "cone_angles",
      [](Array2<const double, 3> starts, Array2<const double, 3> ends, Point apex, Array2<const double, 3> points,
         Array1<double> angles) {
        without_lock(
            [&](Stop& stop) { cone_angles(rows(starts), rows(ends), apex.data(), rows(points), span(angles), stop); });
      },
      array("starts"), array("ends"), array("apex"), array("points"), array("angles"),
      "Fill the `cone_angle` of many points.");
  m.def(
      "boundary_field",
      [](Array2<const double, 3> starts, Array2<const double, 3> ends, Point x, OutPoint gradient,
         Array<double, 3, 3> hessian) {
        without_lock([&](Stop& stop) {
          boundary_field(rows(starts), rows(ends), x.data(), gradient.data(), {hessian.data(), 3}, stop);
        });
      },
      array("starts"), array("ends"), array("x"), array("gradient"), array("hessian"),
      "Fill the gradient and the Hessian of the solid angle, from the boundary edges.");
  m.def(
      "density_moments",
      [](Array2<const double, 3> vertices, Array2<const Index, 3> faces, Array1<const double> areas, Point center,
         OutPoint first, OutPoint second) {
        const DensitySums sums = without_lock([&](Stop& stop) {
          return density_moments(rows(vertices), rows(faces), span(areas), center.data(), first.data(), second.data(),
                                 stop);
        });
        return std::make_tuple(sums.total, sums.square);
      },
      array("vertices"), array("faces"), array("areas"), array("center"), array("first"), array("second"),
      "Sums of w and w^2 / a over triangles with solid angle w and area a; fill the gradients of both.");
  m.def(
      "nearest_point",
      [](Array2<const double, 3> normals, Array1<const double> offsets, Point z, double tolerance, OutPoint y) {
        return without_lock([&](Stop& stop) {
          return nearest_point(rows(normals), span(offsets), z.data(), tolerance, y.data(), stop);
        });
      },
      array("normals"), array("offsets"), array("z"), nb::arg("tolerance"), array("y"),
      "Fill the point of a polytope nearest to z; False where rounding forbids it.");
  m.def(
      "edges_meet",
      [](Array2<const double, 3> starts, Array2<const double, 3> ends, Array2<const double, 3> normals,
         Array1<const double> offsets) {
        return without_lock(
            [&](Stop& stop) { return edges_meet(rows(starts), rows(ends), rows(normals), span(offsets), stop); });
      },
      array("starts"), array("ends"), array("normals"), array("offsets"),
      "Whether a segment has a point with `normals . x <= offsets`.");
  m.def(
      "directions_and_radii",
      [](Array2<const double, 3> vertices, Point center, Array2<double, 3> directions, Array1<double> radii) {
        without_lock([&](Stop& stop) {
          directions_and_radii(rows(vertices), center.data(), rows(directions), span(radii), stop);
        });
      },
      array("vertices"), array("center"), array("directions"), array("radii"),
      "Fill unit directions and distances of vertices from a centre; NaN and 0 at the centre itself.");
  m.def(
      "settle_rays",
      [](Array2<const double, 3> corners, Array2<const Index, 3> faces, Array2<const Index, 3> across,
         Array2<const double, 3> directions, Array1<Index> hits, double slack, Index max_steps, Array1<double> radii) {
        without_lock([&](Stop& stop) {
          settle_rays(rows(corners), rows(faces), rows(across), rows(directions), span(hits), slack, max_steps,
                      span(radii), stop);
        });
      },
      array("corners"), array("faces"), array("across"), array("directions"), array("hits"), nb::arg("slack"),
      nb::arg("max_steps"), array("radii"),
      "Move each hit to the triangle its ray really passes, and fill the distance along the ray.");
  m.def(
      "triangle_distances",
      [](Array2<const double, 3> points, Array<const double, -1, 3, 3> corners, Array1<double> distances) {
        without_lock([&](Stop& stop) {
          triangle_distances(rows(points), {corners.data(), static_cast<Index>(corners.shape(0))}, span(distances),
                             stop);
        });
      },
      array("points"), array("corners"), array("distances"), "Fill the distance of each point from its own triangle.");
}

}  // namespace voxkernel
