#include "clipping.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <utility>

namespace voxkernel {
namespace {

// Corners within so many roundings of a plane count as on it, so that planes that meet in one corner share it.
constexpr double kOn = 0x1p-44;
// Three planes tell a corner better than the cuts that led to it where their determinant is above this.
constexpr double kTelling = 1e-9;

using Vector = std::array<double, 3>;

double dot(const double* a, const double* b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
Vector cross(const double* a, const double* b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

class Solid {
 public:
  Solid(Points normals, Doubles slacks, double reach);
  // Leaves what is behind the plane; false when nothing solid is left or the cut does not close.
  bool cut(Index row);
  // Every corner again, from the three of its planes that tell it best.
  void settle();
  Clipped result() const;

 private:
  struct Face {
    Index row;
    std::vector<Index> ring;
  };
  struct Cut {
    Index low, high, vertex, row;  // the face that asked first
  };
  Index meeting(Index i, Index j, Index row, Index by);
  double corner_of(Index a, Index b, Index c, Vector& corner) const;
  bool close(Index row);
  void forget_unused();

  Index n_;  // rows n_ and after are the cube
  std::vector<Vector> normals_;
  std::vector<double> slacks_;
  std::vector<Vector> vertices_;
  std::vector<Face> faces_, kept_;
  std::vector<double> values_;
  std::vector<Index> follow_;  // around the new face: from a corner to the one after it
  std::vector<Cut> cuts_;
};

Solid::Solid(Points normals, Doubles slacks, double reach) : n_(slacks.size()), slacks_(slacks.begin(), slacks.end()) {
  for (Index i = 0; i < n_; ++i) normals_.push_back({normals(i, 0), normals(i, 1), normals(i, 2)});
  for (int i = 0; i < 8; ++i) {
    vertices_.push_back({i & 1 ? reach : -reach, i & 2 ? reach : -reach, i & 4 ? reach : -reach});
  }
  // Faces -x, +x, -y, +y, -z, +z, counter-clockwise seen from outside.
  const std::array<Index, 4> rings[] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4},
                                        {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};
  for (int f = 0; f < 6; ++f) {
    Vector normal{};
    normal[f / 2] = f % 2 ? 1.0 : -1.0;
    normals_.push_back(normal);
    slacks_.push_back(reach);
    faces_.push_back({n_ + f, {rings[f].begin(), rings[f].end()}});
  }
}

// The common point of three planes; returns their determinant, and leaves the corner alone where that says little.
double Solid::corner_of(Index a, Index b, Index c, Vector& corner) const {
  const Vector bc = cross(normals_[b].data(), normals_[c].data()), ca = cross(normals_[c].data(), normals_[a].data()),
               ab = cross(normals_[a].data(), normals_[b].data());
  const double determinant = dot(normals_[a].data(), bc.data());
  if (std::abs(determinant) > kTelling) {
    for (int k = 0; k < 3; ++k) {
      corner[k] = (slacks_[a] * bc[k] + slacks_[b] * ca[k] + slacks_[c] * ab[k]) / determinant;
    }
  }
  return determinant;
}

// The corner in which plane `by` meets an edge of face `row`. Both faces of the edge ask for it; the second one makes
// it the common point of the three planes, so that cuts of cuts do not add up their rounding.
Index Solid::meeting(Index i, Index j, Index row, Index by) {
  const Index low = std::min(i, j), high = std::max(i, j);
  for (const Cut& cut : cuts_) {
    if (cut.low != low || cut.high != high) continue;
    corner_of(cut.row, row, by, vertices_[cut.vertex]);
    return cut.vertex;
  }
  const double t = values_[low] / (values_[low] - values_[high]);
  Vector v;
  for (int k = 0; k < 3; ++k) v[k] = vertices_[low][k] + t * (vertices_[high][k] - vertices_[low][k]);
  const Index vertex = static_cast<Index>(vertices_.size());
  vertices_.push_back(v);
  values_.push_back(0.0);
  cuts_.push_back({low, high, vertex, row});
  return vertex;
}

bool Solid::cut(Index row) {
  const double* normal = normals_[row].data();
  const std::size_t n = vertices_.size();
  values_.resize(n);
  double extent = 0.0, low = 0.0, high = 0.0;
  for (std::size_t i = 0; i < n; ++i) {
    values_[i] = dot(normal, vertices_[i].data()) - slacks_[row];
    extent = std::max(extent, dot(vertices_[i].data(), vertices_[i].data()));
    low = std::min(low, values_[i]);
    high = std::max(high, values_[i]);
  }
  const double on = kOn * std::sqrt(extent);
  if (high <= on) return true;
  if (low >= -on) return false;
  for (double& value : values_) value = std::abs(value) <= on ? 0.0 : value;
  cuts_.clear();
  kept_.clear();
  for (Face& face : faces_) {
    Face rest{face.row, {}};
    bool is_solid = false;
    const std::size_t size = face.ring.size();
    for (std::size_t k = 0; k < size; ++k) {
      const Index i = face.ring[k], j = face.ring[k + 1 < size ? k + 1 : 0];
      if (values_[i] <= 0.0) {
        rest.ring.push_back(i);
        is_solid = is_solid || values_[i] < 0.0;
      }
      if ((values_[i] < 0.0 && values_[j] > 0.0) || (values_[i] > 0.0 && values_[j] < 0.0)) {
        rest.ring.push_back(meeting(i, j, face.row, row));
      }
    }
    if (is_solid && rest.ring.size() >= 3) kept_.push_back(std::move(rest));
  }
  if (!close(row)) return false;
  std::swap(faces_, kept_);
  forget_unused();
  return true;
}

// Adds the face of the cutting plane: its edges are those that the other faces have on the plane, turned round.
bool Solid::close(Index row) {
  follow_.assign(vertices_.size(), -1);
  Index first = -1, n_edges = 0;
  for (const Face& face : kept_) {
    const std::size_t size = face.ring.size();
    for (std::size_t k = 0; k < size; ++k) {
      const Index i = face.ring[k], j = face.ring[k + 1 < size ? k + 1 : 0];
      if (values_[i] != 0.0 || values_[j] != 0.0) continue;
      if (follow_[j] >= 0) return false;
      follow_[j] = i;
      first = j;
      ++n_edges;
    }
  }
  if (n_edges < 3) return false;
  Face face{row, {}};
  for (Index at = first; n_edges > 0; --n_edges) {
    face.ring.push_back(at);
    at = follow_[at];
    if (at < 0) return false;
    if (at == first && n_edges > 1) return false;
  }
  if (follow_[face.ring.back()] != first) return false;
  kept_.push_back(std::move(face));
  return true;
}

void Solid::forget_unused() {
  std::vector<Index>& number = follow_;
  number.assign(vertices_.size(), -1);
  for (const Face& face : faces_) {
    for (const Index i : face.ring) number[i] = 0;
  }
  Index used = 0;
  for (std::size_t i = 0; i < vertices_.size(); ++i) {
    if (number[i] < 0) continue;
    vertices_[used] = vertices_[i];
    number[i] = used++;
  }
  vertices_.resize(used);
  for (Face& face : faces_) {
    for (Index& i : face.ring) i = number[i];
  }
}

void Solid::settle() {
  std::vector<std::vector<Index>> around(vertices_.size());
  for (const Face& face : faces_) {
    for (const Index i : face.ring) around[i].push_back(face.row);
  }
  for (std::size_t v = 0; v < vertices_.size(); ++v) {
    const std::vector<Index>& rows = around[v];
    if (rows.size() <= 3) continue;  // made by these three already
    Vector corner{};
    double best = 0.0;
    for (std::size_t p = 2; p < rows.size(); ++p) {
      for (std::size_t q = 1; q < p; ++q) {
        const double determinant = std::abs(corner_of(rows[0], rows[q], rows[p], corner));
        if (determinant > kTelling && determinant > best) {
          best = determinant;
          vertices_[v] = corner;
        }
      }
    }
  }
}

Clipped Solid::result() const {
  Clipped found;
  found.is_sound = true;
  found.is_closed = true;
  // Faces by row: the order of the cuts must not show.
  std::vector<Index> order(faces_.size());
  std::iota(order.begin(), order.end(), Index{0});
  std::sort(order.begin(), order.end(), [&](Index i, Index j) { return faces_[i].row < faces_[j].row; });
  found.start.push_back(0);
  for (const Index f : order) {
    const Face& face = faces_[f];
    if (face.row >= n_) found.is_closed = false;
    found.rows.push_back(face.row);
    found.ring.insert(found.ring.end(), face.ring.begin(), face.ring.end());
    found.start.push_back(static_cast<Index>(found.ring.size()));
  }
  for (const Vector& v : vertices_) found.vertices.insert(found.vertices.end(), v.begin(), v.end());
  return found;
}

}  // namespace

// The planes n . v <= slack, all slacks positive, cut a cube of half edge `reach` about the origin, nearest first.
// Nothing here is certain: the caller holds the corners against all planes.
Clipped clipped_polyhedron(Points normals, Doubles slacks, double reach, Stop& stop) {
  std::vector<Index> order(slacks.size());
  std::iota(order.begin(), order.end(), Index{0});
  std::sort(order.begin(), order.end(),
            [&](Index i, Index j) { return slacks[i] != slacks[j] ? slacks[i] < slacks[j] : i < j; });
  Solid solid(normals, slacks, reach);
  for (const Index row : order) {
    stop.poll(64);
    if (!solid.cut(row)) return {};
  }
  solid.settle();
  return solid.result();
}

}  // namespace voxkernel
