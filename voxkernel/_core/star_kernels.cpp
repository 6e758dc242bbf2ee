#include "star_kernels.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "clipping.h"
#include "polyhedron.h"

namespace voxkernel {
namespace {

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

}  // namespace

// The origin sees the whole polyhedron, so it is inside every kernel: no point has to be looked for. The nearest planes
// cut first, because most of the others then do not cut at all.
void star_kernels(Points directions, Triangles faces, Doubles distances, Index first, Index last,
                  const StarKernelAnswers& answers, Stop& stop) {
  const Index n_rays = directions.size(), n_faces = faces.size();
  std::vector<double> corners(3 * n_rays), normals(3 * n_faces), slacks(n_faces);
  std::vector<Plane> planes(n_faces);
  for (Index p = first; p < last; ++p) {
    const double* lengths = distances.part(p * n_rays, (p + 1) * n_rays).data();
    const double scale = *std::max_element(lengths, lengths + n_rays);
    for (Index r = 0; r < n_rays; ++r) {
      for (int k = 0; k < 3; ++k) corners[3 * r + k] = lengths[r] / scale * directions(r, k);
    }
    for (Index f = 0; f < n_faces; ++f) {
      const double* at = corners.data();
      planes[f] = plane_of(at + 3 * faces(f, 0), at + 3 * faces(f, 1), at + 3 * faces(f, 2));
    }
    std::sort(planes.begin(), planes.end(), [](const Plane& a, const Plane& b) { return a.slack < b.slack; });
    for (Index f = 0; f < n_faces; ++f) {
      std::copy_n(planes[f].normal, 3, normals.data() + 3 * f);
      slacks[f] = planes[f].slack;
    }
    answers.outcomes[p] = 0;
    // No plane has moved if one is not a number or the origin is not behind it.
    if (!(slacks[0] > 1e-9) || !std::isfinite(slacks[n_faces - 1])) continue;
    const Clipped found = clipped_polyhedron({normals.data(), n_faces}, slacks, 2.0, stop);
    stop.poll(4 * n_faces);
    if (!found.is_sound || !found.is_closed) continue;
    const Points vertices{found.vertices.data(), static_cast<Index>(found.vertices.size() / 3)};
    answers.volumes[p] = moments(vertices, found.start, found.ring, stop).volume * scale * scale * scale;
    double* box = answers.boxes[p];
    for (int k = 0; k < 3; ++k) {
      box[k] = box[3 + k] = vertices(0, k);
      for (Index v = 1; v < vertices.size(); ++v) {
        box[k] = std::min(box[k], vertices(v, k));
        box[3 + k] = std::max(box[3 + k], vertices(v, k));
      }
      box[k] *= scale;
      box[3 + k] *= scale;
    }
    answers.outcomes[p] = 1;
  }
}

}  // namespace voxkernel
