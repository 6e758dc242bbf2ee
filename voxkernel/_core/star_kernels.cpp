#include "star_kernels.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "cell_kernel.h"
#include "deepest_point.h"
#include "star_hull.h"

namespace voxkernel {
namespace {

constexpr double kNearest = 1e-6;   // planes nearer to the centre are left to the general code
constexpr double kNearly = 1e-11;   // planes so near to each other, for the nearest, are one
constexpr double kRounding = 1e-7;  // largest relative error of a volume
constexpr double kShare = 1e-9;     // no plane may cut more off a hull

struct Plane {
  double normal[3];
  double slack;
};

Plane plane_of(const double* a, const double* b, const double* c) {
  const double ux = b[0] - a[0], uy = b[1] - a[1], uz = b[2] - a[2];
  const double vx = c[0] - a[0], vy = c[1] - a[1], vz = c[2] - a[2];
  Plane plane{{uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx}, 0.0};
  double* n = plane.normal;
  const double length = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
  for (int k = 0; k < 3; ++k) n[k] /= length;
  plane.slack = n[0] * a[0] + n[1] * a[1] + n[2] * a[2];
  return plane;
}

void keep(Index p, double scale, double volume, const double* box, const StarKernelAnswers& answers) {
  answers.volumes[p] = volume * scale * scale * scale;
  for (int k = 0; k < 6; ++k) answers.boxes[p][k] = box[k] * scale;
  answers.outcomes[p] = 1;
}

}  // namespace

// The origin sees the whole polyhedron, so it is inside every kernel: no point has to be looked for. With directions of
// length 1 at most, corners are in the unit ball, as the cutter wants them.
void star_kernels(Points directions, Triangles faces, Doubles distances, Index first, Index last,
                  const StarKernelAnswers& answers, Stop& stop) {
  const Index n_rays = directions.size(), n_faces = faces.size();
  std::vector<double> corners(3 * n_rays);
  HalfSpaceColumns planes(n_faces);
  FaceCutter cutter(n_faces);
  StarHull hull;
  const double origin[3] = {0.0, 0.0, 0.0};
  for (Index p = first; p < last; ++p) {
    const double* lengths = distances.part(p * n_rays, (p + 1) * n_rays).data();
    const double scale = *std::max_element(lengths, lengths + n_rays);
    for (Index r = 0; r < n_rays; ++r) {
      for (int k = 0; k < 3; ++k) corners[3 * r + k] = lengths[r] / scale * directions(r, k);
    }
    planes.size = 0;
    hull.clear();
    double nearest = 1.0;
    for (Index f = 0; f < n_faces; ++f) {
      const double* at = corners.data();
      const Plane plane = plane_of(at + 3 * faces(f, 0), at + 3 * faces(f, 1), at + 3 * faces(f, 2));
      planes.push(plane.normal, plane.slack, 0.0);
      hull.push(plane.normal[0] / plane.slack, plane.normal[1] / plane.slack, plane.normal[2] / plane.slack);
      nearest = plane.slack < nearest ? plane.slack : nearest;
      if (!std::isfinite(plane.slack)) nearest = 0.0;
    }
    stop.poll(n_faces * n_faces);
    answers.outcomes[p] = 0;
    if (!(nearest > kNearest)) continue;
    double box[6], volume;
    if (hull.measure(kShare, &volume, box)) {
      keep(p, scale, volume, box, answers);
      continue;
    }
    const FaceCutter::Solid found = cutter.cut(planes, origin, kNearly * nearest, box);
    // Faces of which the edges do not fit, for their size: floating point has lost one.
    if (found.misfit < 0.0 || found.misfit * found.extent * found.extent > kRounding * found.volume) continue;
    keep(p, scale, found.volume, box, answers);
  }
}

}  // namespace voxkernel
