#include "sphere_angles.h"

#include <algorithm>
#include <cmath>

#include "sphere_vector.h"
#include "stretches.h"

namespace voxkernel {
namespace {

using namespace sphere;

// What `side` of a triangle may be, but 1 and -1: no area, and left to floating point.
constexpr std::int8_t kNone = 0, kFree = 2;

// Numerator and denominator of tan(angle / 2) (van Oosterom and Strackee 1983, eq. 8).
struct HalfTangent {
  double above, below;
};

inline HalfTangent half_tangent(Vector a, Vector b, Vector c, double la, double lb, double lc) {
  const double ab = dot(a, b), bc = dot(b, c), ca = dot(c, a);
  return {dot(a, cross(b, c)), la * lb * lc + ab * lc + bc * la + ca * lb};
}

// A sum in order that keeps the digits the smaller term loses (Neumaier).
class Sum {
 public:
  void add(double term) {
    const double next = sum_ + term;
    carry_ += std::abs(sum_) >= std::abs(term) ? (sum_ - next) + term : (term - next) + sum_;
    sum_ = next;
  }
  double value() const { return sum_ + carry_; }

 private:
  double sum_ = 0.0, carry_ = 0.0;
};

// What an edge a to b adds to the gradient of the solid angle at the origin.
inline Vector edge_gradient(Vector a, Vector b, double la, double lb) {
  const double below = la * lb * (la * lb + a.x * b.x + a.y * b.y + a.z * b.z);
  return cross(a, b) * (below > 0.0 ? (la + lb) / below : 0.0);
}

}  // namespace

// Signed solid angle of each triangle; their sum and that of their sizes, compensated, in order.
//
// side[i] is 1 or -1 where the sign is known exactly, 2 where it is left to floating point, 0 for triangles without
// area.
AngleSums triangle_angles(Points vertices, Triangles faces, const double* center, Span<const std::int8_t> side,
                          Span<double> angles, Stop& stop) {
  Sum total, size;
  for_each(faces.size(), 8, stop, [&](Index i) {
    angles[i] = 0.0;
    if (side[i] == kNone) return;
    const Vector a = difference(vertices[faces(i, 0)], center), b = difference(vertices[faces(i, 1)], center),
                 c = difference(vertices[faces(i, 2)], center);
    const auto [above, below] = half_tangent(a, b, c, length(a), length(b), length(c));
    const double angle =
        side[i] == kFree ? 2.0 * std::atan2(above, below) : side[i] * 2.0 * std::atan2(std::abs(above), below);
    angles[i] = angle;
    total.add(angle);
    size.add(std::abs(angle));
  });
  return {total.value(), size.value()};
}

// Solid angle, modulo 4 pi, of a surface with these boundary edges: that of the cone over them.
//
// The half angles add up as the arguments of complex numbers do, so one arctangent is enough.
double cone_angle(Points starts, Points ends, const double* apex, const double* x, Stop& stop) {
  const Vector p = difference(apex, x);
  const double lp = length(p);
  double re = 1.0, im = 0.0;
  for_each(starts.size(), 8, stop, [&](Index e) {
    const Vector a = difference(starts[e], x), b = difference(ends[e], x);
    auto [v, u] = half_tangent(p, a, b, lp, length(a), length(b));
    const double size = std::sqrt(u * u + v * v);
    if (size > 0.0) {
      u /= size;
      v /= size;
      const double turned = re * u - im * v;
      im = re * v + im * u;
      re = turned;
    }
  });
  return 2.0 * std::atan2(im, re);
}

// `cone_angle` of many points.
void cone_angles(Points starts, Points ends, const double* apex, Points points, Span<double> angles, Stop& stop) {
  for (Index i = 0; i < points.size(); ++i) angles[i] = cone_angle(starts, ends, apex, points[i], stop);
}

// Gradient and Hessian of the solid angle: the line integral of dl x r / r^3 along the boundary edges.
void boundary_field(Points starts, Points ends, const double* x, double* gradient, Rows<double, 3> hessian,
                    Stop& stop) {
  std::fill_n(gradient, 3, 0.0);
  std::fill_n(hessian.data(), 9, 0.0);
  for (Index e = 0; e < starts.size(); ++e) {
    stop.poll(8);
    const Vector a = difference(starts[e], x), b = difference(ends[e], x);
    const double la = length(a), lb = length(b), along = dot(a, b);
    const double below = la * lb * (la * lb + along);
    if (!(below > 0.0)) continue;  // the point lies on the edge
    const Vector c = cross(a, b), d = a - b;
    const double weight = (la + lb) / below;
    gradient[0] += weight * c.x;
    gradient[1] += weight * c.y;
    gradient[2] += weight * c.z;
    // d(weight) along the three axes; moving x by d moves a and b by -d, and turns the cross product.
    const double turn[3][3] = {{0.0, d.z, -d.y}, {-d.z, 0.0, d.x}, {d.y, -d.x, 0.0}};
    const double as[3] = {a.x, a.y, a.z}, bs[3] = {b.x, b.y, b.z};
    for (int k = 0; k < 3; ++k) {
      const double da = -as[k] / la, db = -bs[k] / lb, change_along = -(as[k] + bs[k]);
      const double change = 2.0 * la * lb * (lb * da + la * db) + (da * lb + la * db) * along + la * lb * change_along;
      const double slope = (da + db) / below - (la + lb) * change / (below * below);
      hessian(0, k) += weight * turn[0][k] + slope * c.x;
      hessian(1, k) += weight * turn[1][k] + slope * c.y;
      hessian(2, k) += weight * turn[2][k] + slope * c.z;
    }
  }
}

// Sums of w and w^2 / a over triangles with solid angle w and area a, and the gradients of both.
//
// For a centre on the inner side of all triangles: no w is negative.
DensitySums density_moments(Points vertices, Triangles faces, Doubles areas, const double* center, double* first,
                            double* second, Stop& stop) {
  double total = 0.0, square = 0.0;
  Vector one{0.0, 0.0, 0.0}, two{0.0, 0.0, 0.0};
  for_each(faces.size(), 8, stop, [&](Index i) {
    if (!(areas[i] > 0.0)) return;
    const Vector a = difference(vertices[faces(i, 0)], center), b = difference(vertices[faces(i, 1)], center),
                 c = difference(vertices[faces(i, 2)], center);
    const double la = length(a), lb = length(b), lc = length(c);
    const auto [above, below] = half_tangent(a, b, c, la, lb, lc);
    const double angle = 2.0 * std::atan2(std::max(above, 0.0), below);
    const Vector gradient = edge_gradient(a, b, la, lb) + edge_gradient(b, c, lb, lc) + edge_gradient(c, a, lc, la);
    total += angle;
    square += angle * angle / areas[i];
    one = one + gradient;
    two = two + gradient * (2.0 * angle / areas[i]);
  });
  first[0] = one.x, first[1] = one.y, first[2] = one.z;
  second[0] = two.x, second[1] = two.y, second[2] = two.z;
  return {total, square};
}

}  // namespace voxkernel
