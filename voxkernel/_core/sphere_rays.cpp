#include "sphere_rays.h"

#include <cmath>
#include <limits>

#include "sphere_vector.h"
#include "stretches.h"

namespace voxkernel {
namespace {

using namespace sphere;

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

struct Triangle {
  Vector a, b, c;
};

Triangle triangle_of(Points corners, Triangles faces, Index i) {
  return {vector(corners[faces(i, 0)]), vector(corners[faces(i, 1)]), vector(corners[faces(i, 2)])};
}

// The edge a ray lies beyond most, and the sine of how far it is on the inner side of it; edge -1 where it is on the
// inner side of all three, and then the sine is not computed but said to be 0.
struct Beyond {
  double low = kInfinity;
  int edge = -1;
};

Beyond farthest_edge(const Triangle& t, Vector ray) {
  const Vector normals[3] = {cross(t.a, t.b), cross(t.b, t.c), cross(t.c, t.a)};
  // On which side of the plane through the centre and an edge the third corner lies gives the turn of all three.
  const double turn = dot(t.c, normals[0]) >= 0.0 ? 1.0 : -1.0;
  const double sides[3] = {turn * dot(ray, normals[0]), turn * dot(ray, normals[1]), turn * dot(ray, normals[2])};
  if (sides[0] >= 0.0 && sides[1] >= 0.0 && sides[2] >= 0.0) return {0.0, -1};
  Beyond found;
  for (int k = 0; k < 3; ++k) {
    const double size = length(normals[k]);
    const double side = size > 0.0 ? sides[k] / size : 0.0;
    if (side < found.low) found = {side, k};
  }
  return found;
}

// Distance along a ray from the centre to the plane of a triangle; NaN where it does not come there.
double distance_to_plane(const Triangle& t, Vector ray) {
  const Vector normal = cross(t.b - t.a, t.c - t.a);
  const double along = dot(normal, ray), distance = dot(normal, t.a) / along;
  return along != 0.0 && distance > 0.0 ? distance : kNaN;
}

// The point of a triangle nearest to p (Ericson, Real-Time Collision Detection, 5.1.5).
Vector nearest_in_triangle(Vector p, const Triangle& t) {
  const Vector ab = t.b - t.a, ac = t.c - t.a, ap = p - t.a, bp = p - t.b, cp = p - t.c;
  const double d1 = dot(ab, ap), d2 = dot(ac, ap), d3 = dot(ab, bp), d4 = dot(ac, bp), d5 = dot(ab, cp),
               d6 = dot(ac, cp);
  if (d1 <= 0.0 && d2 <= 0.0) return t.a;
  if (d3 >= 0.0 && d4 <= d3) return t.b;
  if (d6 >= 0.0 && d5 <= d6) return t.c;
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0) return d1 > d3 ? t.a + ab * (d1 / (d1 - d3)) : t.a;
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0) return d2 > d6 ? t.a + ac * (d2 / (d2 - d6)) : t.a;
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0.0 && d4 >= d3 && d5 >= d6) return t.b + (t.c - t.b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
  return t.a + ab * (vb / (va + vb + vc)) + ac * (vc / (va + vb + vc));
}

}  // namespace

// Projects vertices on the unit sphere around a centre; a vertex at the centre gets NaN and radius 0.
void directions_and_radii(Points vertices, const double* center, Rows<double, 3> directions, Span<double> radii,
                          Stop& stop) {
  for_each(vertices.size(), 1, stop, [&](Index i) {
    const Vector v = difference(vertices[i], center);
    const double r = length(v);
    radii[i] = r;
    directions(i, 0) = r > 0.0 ? v.x / r : kNaN;
    directions(i, 1) = r > 0.0 ? v.y / r : kNaN;
    directions(i, 2) = r > 0.0 ? v.z / r : kNaN;
  });
}

// Moves each hit to the triangle its ray really passes, in double precision, and computes the distance.
//
// corners: vertices relative to the centre. across: neighbour over edge k (from corner k to the next), -1 at a
// border. hits: triangle of each ray as a first guess, -1 for none; changed.
// A ray goes over the edge it lies beyond most until it is inside, at most `max_steps` times; where that
// leads nowhere the triangle it misses least stays, but -1 where that is by more than `slack` (a sine).
void settle_rays(Points corners, Triangles faces, Triangles across, Points directions, Span<Index> hits, double slack,
                 Index max_steps, Span<double> radii, Stop& stop) {
  for_each(directions.size(), 8, stop, [&](Index r) {
    radii[r] = kNaN;
    Index at = hits[r];
    if (at < 0) return;
    const Vector ray = vector(directions[r]);
    double best = -kInfinity;
    Index chosen = at, came_from = -1;
    for (Index step = 0; step < max_steps; ++step) {
      if (step % 64 == 63) stop.poll(64 * 8);
      const Beyond beyond = farthest_edge(triangle_of(corners, faces, at), ray);
      if (beyond.low > best) best = beyond.low, chosen = at;
      if (beyond.low >= 0.0) break;
      const Index after = across(at, beyond.edge);
      if (after < 0 || after == came_from) break;
      came_from = at;
      at = after;
    }
    hits[r] = -1;
    if (best < -slack) return;
    radii[r] = distance_to_plane(triangle_of(corners, faces, chosen), ray);
    if (radii[r] > 0.0) hits[r] = chosen;
  });
}

// Distance of each point from its own triangle, whose corners follow each other in a row.
void triangle_distances(Points points, Rows<const double, 9> corners, Span<double> distances, Stop& stop) {
  for_each(points.size(), 4, stop, [&](Index i) {
    const Vector p = vector(points[i]);
    const Triangle t{vector(corners[i]), vector(corners[i] + 3), vector(corners[i] + 6)};
    distances[i] = length(p - nearest_in_triangle(p, t));
  });
}

}  // namespace voxkernel
