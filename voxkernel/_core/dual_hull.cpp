// The convex hull of the dual points n / s, s = d - n . centre: a plane of it is a vertex, a point of it a face.
//
// The one question is on which side of plane l the common point of planes i, j, k lies: the sign of the determinant of
// the rows (n, s), which is s_i s_j s_k s_l times the volume spanned by the dual points. Triangles in one plane are
// taken together: they are one vertex of the polytope. Planes that touch the polytope in a vertex or an edge only drop
// out then.
#include "dual_hull.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "common_point.h"
#include "dual_insertion.h"
#include "pages.h"
#include "workers.h"

namespace voxkernel {
namespace {

constexpr Index kLeast = 1 << 12;  // faces or vertices that are worth a thread

using Place = std::int32_t;
using Corners = std::array<Place, 3>;

template <typename T, typename A>
void forget(std::vector<T, A>& values) {
  std::vector<T, A>().swap(values);
}

// The polygons of a stretch of points.
struct Polygons {
  Brief<Place> face;  // the place of its point
  Brief<Place> size, ring;
};

class PolytopeReader {
 public:
  PolytopeReader(const LocalPlanes& planes, const PlaneLattice& lattice, DualPoints& duals, Triangulation& hull,
                 std::vector<Inserter>& inserters, Stop& stop)
      : planes_(planes), lattice_(lattice), duals_(duals), hull_(hull), inserters_(inserters), stop_(stop) {}

  HullPolytope read() {
    HullPolytope found;
    const Place n = duals_.size(), size = hull_.size;
    for (Place i = 0; i < size; ++i) {
      const DualTriangle& t = hull_.triangles[i];
      if (t.is_there() && std::max({t.corner[0], t.corner[1], t.corner[2]}) >= n) found.is_closed = false;
    }
    if (!found.is_closed) return found;
    number_vertices();
    forget(duals_.points);
    find_polygons();
    keep_corners();
    forget(number_);
    choose_shared_corners();
    forget(hull_.first_same);
    write(found);
    return found;
  }

 private:
  int threads() const { return static_cast<int>(inserters_.size()); }

  // Calls `work(first, last, part, stop)` for stretches of 0 .. size.
  template <typename Work>
  int each_part(Index size, Work&& work) {
    const int n = worth_threads(size, kLeast, threads());
    run_parts(n, stop_, [&](int part, Stop& own) {
      work(static_cast<Place>(part_begin(size, n, part)), static_cast<Place>(part_begin(size, n, part + 1)), part, own);
    });
    return n;
  }

  // The same for shorter stretches, of which each thread takes the next one.
  template <typename Work>
  void each_in_turn(Index size, Work&& work) {
    const int n = worth_threads(size, kLeast, threads());
    run_in_turn(size, n, stop_, [&](Index first, Index last, int part, Stop& own) {
      work(static_cast<Place>(first), static_cast<Place>(last), part, own);
    });
  }

  // Triangles in one plane have one number: a vertex of the polytope.
  void number_vertices() {
    const Place size = hull_.size;
    each_in_turn(size, [&](Place first, Place last, int part, Stop& own) {
      DualSigns& signs = inserters_[part].signs;
      for (Place i = first; i < last; ++i) {
        own.poll(4);
        DualTriangle& t = hull_.triangles[i];
        t.mark = 0;  // of the edges that are flat
        for (int k = 0; k < 3 && t.is_there(); ++k) {
          const DualTriangle& o = hull_.triangles[t.across[k]];
          if (t.across[k] < i) continue;
          int opposite = 0;
          while (o.across[opposite] != i) ++opposite;
          if (signs.beyond(t.corner[0], t.corner[1], t.corner[2], o.corner[opposite]) == 0) t.mark |= 1 << k;
        }
      }
    });
    // Each triangle points to one before it that is in its plane, in the end to the first.
    number_.resize(size);
    for (Place i = 0; i < size; ++i) number_[i] = i;
    const auto first_of = [&](Place i) {
      while (number_[i] != i) i = number_[i] = number_[number_[i]];
      return i;
    };
    for (Place i = 0; i < size; ++i) {
      stop_.poll();
      const DualTriangle& t = hull_.triangles[i];
      for (int k = 0; t.mark != 0 && k < 3; ++k) {
        if ((t.mark >> k & 1) == 0) continue;
        const Place a = first_of(i), b = first_of(t.across[k]);
        number_[std::max(a, b)] = std::min(a, b);
      }
    }
    n_vertices_ = 0;
    Brief<char> is_shared;
    for (Place i = 0; i < size; ++i) {
      stop_.poll();
      if (!hull_.triangles[i].is_there()) {
        number_[i] = -1;
      } else if (number_[i] == i) {
        number_[i] = n_vertices_++;
        is_shared.push_back(0);
      } else {
        number_[i] = number_[number_[i]];
        is_shared[number_[i]] = 1;
      }
    }
    is_shared_.swap(is_shared);
  }

  Place row_of(Place place) const { return duals_.rows[place]; }
  // The place of the first half-space that is the same.
  Place face_of(Place point) const { return hull_.first_same[point]; }

  // The three faces of every vertex, of one triangle of it, in the memory of the triangles. Of vertices that have more
  // faces three others are chosen.
  void keep_corners() {
    each_in_turn(hull_.size, [&](Place first, Place last, int, Stop& own) {
      for (Place i = first; i < last; ++i) {
        own.poll();
        DualTriangle& t = hull_.triangles[i];
        if (!t.is_there()) continue;
        for (Place& corner : t.corner) corner = face_of(corner);
        std::sort(t.corner, t.corner + 3, [&](Place a, Place b) { return row_of(a) < row_of(b); });
      }
    });
    corners_ = reinterpret_cast<Corners*>(hull_.triangles.get());  // written never beyond what was read
    Place next = 0;
    for (Place i = 0; i < hull_.size; ++i) {
      stop_.poll();
      if (number_[i] != next) continue;
      const DualTriangle t = hull_.triangles[i];
      corners_[next++] = {t.corner[0], t.corner[1], t.corner[2]};
    }
    hull_.triangles.shrink(n_vertices_ * sizeof(Corners) / sizeof(DualTriangle) + 1);
  }

  // The vertices around every dual point that has three and more.
  void find_polygons() {
    Brief<Place>& around = hull_.slots;
    std::fill(around.begin(), around.end(), -1);
    const Place size = hull_.size;
    for (Place i = 0; i < size; ++i) {
      if (!hull_.triangles[i].is_there()) continue;
      for (const Place c : hull_.triangles[i].corner) around[c] = i;
    }
    // Room taken here is given back when it is freed, other than that of a thread.
    std::vector<Polygons> parts(threads());
    for (Polygons& part : parts) {
      part.ring.reserve(static_cast<std::size_t>(4) * (size - 4) / parts.size());  // of 3 corners each, and some
      part.face.reserve(duals_.size() / parts.size() + 1);
      part.size.reserve(duals_.size() / parts.size() + 1);
    }
    const int n_parts = each_part(duals_.size(), [&](Place first, Place last, int part, Stop& own) {
      Polygons& found = parts[part];
      for (Place p = first; p < last; ++p) {
        if (around[p] < 0) continue;
        const std::size_t begin = found.ring.size();
        Place at = around[p];
        do {
          own.poll();
          const DualTriangle& t = hull_.triangles[at];
          int k = 0;
          while (t.corner[k] != p) ++k;
          if (found.ring.size() == begin || found.ring.back() != number_[at]) found.ring.push_back(number_[at]);
          at = t.across[(k + 1) % 3];
        } while (at != around[p]);
        while (found.ring.size() > begin + 1 && found.ring.back() == found.ring[begin]) found.ring.pop_back();
        if (found.ring.size() < begin + 3) {
          found.ring.resize(begin);
          continue;
        }
        found.face.push_back(face_of(p));
        found.size.push_back(static_cast<Place>(found.ring.size() - begin));
      }
    });
    forget(around);
    parts.resize(n_parts);
    parts_.swap(parts);
  }

  // Calls `visit(face, ring, size)` for every polygon.
  template <typename Visit>
  void each_polygon(Visit&& visit) const {
    for (const Polygons& part : parts_) each_polygon_of(part, visit);
  }
  template <typename Visit>
  static void each_polygon_of(const Polygons& part, Visit&& visit) {
    const Place* ring = part.ring.data();
    for (std::size_t f = 0; f < part.face.size(); ++f) {
      visit(part.face[f], ring, part.size[f]);
      ring += part.size[f];
    }
  }

  // Of vertices where more than three faces meet, three the widest apart.
  void choose_shared_corners() {
    Brief<Place> first(n_vertices_ + 1, 0);
    each_polygon([&](Place, const Place* ring, Place size) {
      for (Place j = 0; j < size; ++j) first[ring[j] + 1] += is_shared_[ring[j]];
    });
    for (Place v = 0; v < n_vertices_; ++v) first[v + 1] += first[v];
    if (first[n_vertices_] == 0) return;
    Brief<Place> around(first[n_vertices_]), fill(first.begin(), first.end() - 1);
    each_polygon([&](Place face, const Place* ring, Place size) {
      for (Place j = 0; j < size; ++j) {
        if (is_shared_[ring[j]] != 0) around[fill[ring[j]]++] = face;
      }
    });
    forget(fill);
    each_in_turn(n_vertices_, [&](Place begin, Place end, int part, Stop& own) {
      PointMaker maker(planes_, duals_, lattice_);
      for (Place v = begin; v < end; ++v) {
        own.poll(4);
        if (is_shared_[v] == 0) continue;
        Place* low = around.data() + first[v];
        const Place n = first[v + 1] - first[v];
        std::sort(low, low + n, [&](Place a, Place b) { return row_of(a) < row_of(b); });
        corners_[v] = widest(low, n, maker, inserters_[part].signs.exact);
      }
    });
  }

  // Of faces in ascending order, three whose planes meet in one point.
  static Corners widest(const Place* faces, Place n, PointMaker& maker, ExactPlanes& exact) {
    if (n == 3) return {faces[0], faces[1], faces[2]};
    std::vector<DualPoint> points(n);
    for (Place j = 0; j < n; ++j) maker.make(faces[j], points[j]);
    const double* a = points[0].q;
    const auto cross_size = [&](const double* b) {
      const double c[3] = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
      return size_of(c) / size_of(b);
    };
    Place second = 1, third = -1;
    for (Place j = 2; j < n; ++j) {
      if (cross_size(points[j].q) > cross_size(points[second].q)) second = j;
    }
    const auto meet = [&](Place j) {
      const int sign = rounded_side(points[0], points[second], points[j]);
      return (sign == 2 ? exact.normals_sign(faces[0], faces[second], faces[j]) : sign) != 0;
    };
    double best = -1.0;
    for (Place j = 1; j < n; ++j) {
      if (j == second) continue;
      const double value = std::abs(determinant(a, points[second].q, points[j].q)) / size_of(points[j].q);
      if (value > best && meet(j)) {
        best = value;
        third = j;
      }
    }
    return {faces[0], faces[std::min(second, third)], faces[std::max(second, third)]};
  }

  // A polygon: its row, where its ring lies, and the vertex of the lowest rows on it.
  struct Face {
    Place row;
    Place size;
    const Place* ring;
    Place least;
  };

  // Faces in the order of their rows, vertices numbered by their first appearance, polygons turned to the vertex of the
  // lowest rows. Three places of a vertex stand where its rows will.
  void write(HullPolytope& found) {
    Brief<Face> faces = sorted_faces();
    for (Polygons& part : parts_) {
      forget(part.face);
      forget(part.size);
    }
    const auto n_faces = static_cast<Place>(faces.size());
    each_in_turn(n_faces, [&](Place first, Place last, int, Stop& own) {
      for (Place f = first; f < last; ++f) {
        own.poll(8);
        Face& face = faces[f];
        for (Place j = 1; j < face.size; ++j) {
          if (is_lower(face.ring[j], face.ring[face.least])) face.least = j;
        }
      }
    });
    Brief<Place> renamed(n_vertices_, -1);
    Place count = 0;
    found.start.reserve(n_faces + 1);
    found.start.push_back(0);
    found.rows.reserve(n_faces);
    for (const Face& face : faces) {
      stop_.poll(4);
      for (Place j = 0; j < face.size; ++j) {
        Place& name = renamed[face.ring[(face.least + j) % face.size]];
        if (name < 0) name = count++;
      }
      found.rows.push_back(face.row);
      found.start.push_back(found.start.back() + face.size);
    }
    found.ring.resize(found.start.back());
    each_in_turn(n_faces, [&](Place first, Place last, int, Stop& own) {
      for (Place f = first; f < last; ++f) {
        own.poll(4);
        const Face& face = faces[f];
        Place* ring = &found.ring[found.start[f]];
        for (Place j = 0; j < face.size; ++j) ring[j] = renamed[face.ring[(face.least + j) % face.size]];
      }
    });
    forget(faces);
    forget(parts_);
    found.vertex_rows.resize(static_cast<std::size_t>(3) * count);
    each_in_turn(n_vertices_, [&](Place first, Place last, int, Stop& own) {
      for (Place v = first; v < last; ++v) {
        own.poll();
        if (renamed[v] < 0) continue;
        for (int k = 0; k < 3; ++k) found.vertex_rows[3 * static_cast<Index>(renamed[v]) + k] = corners_[v][k];
      }
    });
    forget(renamed);
    hull_.triangles.reset();
    find_vertices(found);
  }

  // Polygons in the order of their rows, which are different. Where they are many, each goes straight to its place.
  Brief<Face> sorted_faces() {
    std::size_t count = 0;
    for (const Polygons& part : parts_) count += part.face.size();
    const auto made = [&](Place face, const Place* ring, Place size) { return Face{row_of(face), size, ring, 0}; };
    Brief<Face> faces;
    const Index n_rows = planes_.offsets.size();
    if (static_cast<Index>(count) < n_rows / 8) {
      faces.reserve(count);
      each_polygon([&](Place face, const Place* ring, Place size) { faces.push_back(made(face, ring, size)); });
      std::sort(faces.begin(), faces.end(), [](const Face& a, const Face& b) { return a.row < b.row; });
      return faces;
    }
    Brief<Place> rank(n_rows + 1, 0);
    each_own_polygon([&](Place face, const Place*, Place) { rank[row_of(face) + 1] = 1; });
    for (Index row = 0; row < n_rows; ++row) rank[row + 1] += rank[row];
    faces.resize(count);
    each_own_polygon(
        [&](Place face, const Place* ring, Place size) { faces[rank[row_of(face)]] = made(face, ring, size); });
    return faces;
  }

  // The same as `each_polygon` on several threads, each with those that it found.
  template <typename Visit>
  void each_own_polygon(Visit&& visit) {
    run_parts(static_cast<int>(parts_.size()), stop_, [&](int part, Stop& own) {
      own.poll(static_cast<Index>(parts_[part].face.size()));
      each_polygon_of(parts_[part], visit);
    });
  }

  bool is_lower(Place v, Place w) const {
    for (int k = 0; k < 3; ++k) {
      const Place a = row_of(corners_[v][k]), b = row_of(corners_[w][k]);
      if (a != b) return a < b;
    }
    return false;
  }

  // The vertices in which three planes meet, and bounds on the errors of their coordinates.
  void find_vertices(HullPolytope& found) {
    found.vertices.resize(found.vertex_rows.size());
    std::vector<double> errors(threads(), 0.0);
    each_in_turn(static_cast<Index>(found.vertices.size() / 3), [&](Place first, Place last, int part, Stop& own) {
      CommonPoints points(lattice_.source, duals_.rows, planes_.scale);
      for (Place v = first; v < last; ++v) {
        own.poll(4);
        Place* rows = &found.vertex_rows[3 * static_cast<Index>(v)];
        double* point = &found.vertices[3 * static_cast<Index>(v)];
        double error = points.find(rows[0], rows[1], rows[2], point);
        if (!std::isfinite(error)) {
          inserters_[part].signs.exact.common_point(rows[0], rows[1], rows[2], planes_.scale, point);
          error = 0x1p-48 * size_of(point);
        }
        errors[part] = std::max(errors[part], error);
        for (int k = 0; k < 3; ++k) rows[k] = duals_.rows[rows[k]];
      }
    });
    found.vertex_error = *std::max_element(errors.begin(), errors.end());
  }

  const LocalPlanes& planes_;
  const PlaneLattice& lattice_;
  DualPoints& duals_;
  Triangulation& hull_;
  std::vector<Inserter>& inserters_;
  Stop& stop_;
  Brief<Place> number_;         // of a triangle: its vertex
  Brief<char> is_shared_;       // of a vertex: whether it is several triangles
  Corners* corners_ = nullptr;  // of a vertex: three places, ascending by row
  std::vector<Polygons> parts_;
  Place n_vertices_ = 0;
};

}  // namespace

HullPolytope dual_hull(const LocalPlanes& planes, const PlaneSource& source, std::vector<Index>&& rows,
                       int cube_exponent, int threads, Stop& stop) {
  threads = worth_threads(static_cast<Index>(rows.size()), kLeast, threads);
  DualPoints duals;
  sort_rows(planes, rows, duals, threads, stop);
  forget(rows);
  const PlaneLattice lattice(source, duals.rows, cube_exponent);
  if (!find_points(planes, lattice, duals, threads, stop)) {
    HullPolytope nothing;
    nothing.is_inside = false;
    return nothing;
  }
  Triangulation hull(duals, threads);
  std::vector<Inserter> inserters;
  inserters.reserve(threads);
  for (int i = 0; i < threads; ++i) inserters.emplace_back(duals, lattice, hull);
  insert_all(duals, inserters, stop);
  return PolytopeReader(planes, lattice, duals, hull, inserters, stop).read();
}

}  // namespace voxkernel
