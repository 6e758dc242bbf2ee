#include "star_kernels.h"

#include <algorithm>
#include <array>
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

using Three = std::array<std::int32_t, 3>;

// For each face, those across its edges.
std::vector<Three> faces_across(Triangles faces) {
  std::vector<std::array<Index, 4>> edges;  // ends, the face, which of its edges
  for (Index f = 0; f < faces.size(); ++f) {
    for (Index k = 0; k < 3; ++k) {
      const Index a = faces(f, k), b = faces(f, (k + 1) % 3);
      edges.push_back({std::min(a, b), std::max(a, b), f, k});
    }
  }
  std::sort(edges.begin(), edges.end());
  std::vector<Three> across(faces.size(), Three{0, 0, 0});
  for (std::size_t e = 0; e + 1 < edges.size(); e += 2) {
    across[edges[e][2]][edges[e][3]] = static_cast<std::int32_t>(edges[e + 1][2]);
    across[edges[e + 1][2]][edges[e + 1][3]] = static_cast<std::int32_t>(edges[e][2]);
  }
  return across;
}

// n . x = slack; the normal is as long as twice the area of the face.
struct Plane {
  double normal[3];
  double slack;
};

Plane plane_of(const double* a, const double* b, const double* c) {
  const double ux = b[0] - a[0], uy = b[1] - a[1], uz = b[2] - a[2];
  const double vx = c[0] - a[0], vy = c[1] - a[1], vz = c[2] - a[2];
  Plane plane{{uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx}, 0.0};
  const double* n = plane.normal;
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
  const std::vector<Three> across = faces_across(faces);
  std::vector<Plane> faces_at(n_faces);
  const double origin[3] = {0.0, 0.0, 0.0};
  for (Index p = first; p < last; ++p) {
    const double* lengths = distances.part(p * n_rays, (p + 1) * n_rays).data();
    const double scale = *std::max_element(lengths, lengths + n_rays);
    for (Index r = 0; r < n_rays; ++r) {
      const double share = lengths[r] / scale;
      for (int k = 0; k < 3; ++k) corners[3 * r + k] = share * directions(r, k);
    }
    hull.clear();
    double farthest = 1.0;
    for (Index f = 0; f < n_faces; ++f) {
      const double* at = corners.data();
      faces_at[f] = plane_of(at + 3 * faces(f, 0), at + 3 * faces(f, 1), at + 3 * faces(f, 2));
      const auto& [n, slack] = faces_at[f];
      const double share = 1.0 / slack, x = n[0] * share, y = n[1] * share, z = n[2] * share;
      const double square = x * x + y * y + z * z;
      hull.push(x, y, z);
      farthest = square <= farthest ? farthest : square;  // NaN stays
    }
    stop.poll(n_faces * n_faces);
    answers.outcomes[p] = 0;
    if (!(farthest * kNearest * kNearest < 1.0)) continue;
    double box[6], volume;
    if (hull.measure(kShare, across, &volume, box)) {
      keep(p, scale, volume, box, answers);
      continue;
    }
    planes.size = 0;
    for (const auto& [n, slack] : faces_at) {
      const double length = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
      const double unit[3] = {n[0] / length, n[1] / length, n[2] / length};
      planes.push(unit, slack / length, 0.0);
    }
    const FaceCutter::Solid found = cutter.cut(planes, origin, kNearly / std::sqrt(farthest), box);
    // Faces of which the edges do not fit, for their size: floating point has lost one.
    if (found.misfit < 0.0 || found.misfit * found.extent * found.extent > kRounding * found.volume) continue;
    keep(p, scale, found.volume, box, answers);
  }
}

}  // namespace voxkernel
