#include "polyhedron.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace voxkernel {
namespace {

// Edges around one dual point: from one neighbour to the next, with the triangle between them.
struct Turn {
  Index from, to, owner;
};

}  // namespace

// Tells which triangles of a closed hull turn like triangle `first`, by walking from neighbour to neighbour.
//
// neighbours_of(i, k) is the triangle across the edge opposite corner k of triangle i. Two neighbours turn
// alike when they traverse their edge in opposite directions; no coordinate is looked at, so triangles
// without area are turned as well as any other.
Turns consistent_turns(Triangles simplices, Triangles neighbours_of, Index first, Stop& stop) {
  const Index m = simplices.size();
  Turns turns{std::vector<char>(m, 0), false};
  std::vector<char> seen(m, 0);
  std::vector<Index> stack{first};
  turns.alike[first] = seen[first] = 1;
  Index reached = 1;
  while (!stack.empty()) {
    stop.poll();
    const Index i = stack.back();
    stack.pop_back();
    for (int k = 0; k < 3; ++k) {
      const Index j = neighbours_of(i, k);
      if (j < 0 || seen[j]) continue;
      const Index u = simplices(i, (k + 1) % 3), v = simplices(i, (k + 2) % 3);
      bool same = true;  // whether j lists the edge as v, u
      for (int q = 0; q < 3; ++q) {
        if (simplices(j, q) == u && simplices(j, (q + 1) % 3) == v) same = false;
      }
      turns.alike[j] = (turns.alike[i] != 0) == same;
      seen[j] = 1;
      stack.push_back(j);
      ++reached;
    }
  }
  turns.all_reached = reached == m;
  return turns;
}

// Lists the polygon of every dual point: the vertices of the triangles around it, in order.
//
// simplices are the dual points of each hull triangle; outward[i] is false where the triangle must be turned
// to be counter-clockwise seen from outside; vertex_ids are the primal vertices. The polygon of dual point p
// is ring[start[p]:start[p + 1]], repeated vertices dropped, empty where fewer than three are left.
Rings dual_faces(Triangles simplices, Span<const bool> outward, Indices vertex_ids, Index n_duals, Stop& stop) {
  const Index m = simplices.size();
  std::vector<Index> first(n_duals + 1, 0);
  for (Index i = 0; i < m; ++i) {
    for (int k = 0; k < 3; ++k) ++first[simplices(i, k) + 1];
  }
  for (Index p = 0; p < n_duals; ++p) first[p + 1] += first[p];
  std::vector<Turn> turns(3 * m);
  std::vector<Index> fill(first.begin(), first.end() - 1);
  for (Index i = 0; i < m; ++i) {
    stop.poll();
    for (int k = 0; k < 3; ++k) {
      Index u = simplices(i, (k + 1) % 3), v = simplices(i, (k + 2) % 3);
      if (!outward[i]) std::swap(u, v);
      turns[fill[simplices(i, k)]++] = {u, v, i};
    }
  }
  Rings rings{std::vector<Index>(n_duals + 1, 0), {}, true};
  rings.ring.reserve(3 * m);
  for (Index p = 0; p < n_duals; ++p) {
    const auto low = turns.begin() + first[p], high = turns.begin() + first[p + 1];
    const Index n = high - low;
    const std::size_t begin = rings.ring.size();
    if (n >= 3) {
      stop.poll(n);
      // A closed hull leaves each neighbour of p once, so that no two keys are equal.
      std::sort(low, high, [](const Turn& a, const Turn& b) { return a.from < b.from; });
      // Polygons begin at the first of their triangles.
      const auto begin_turn =
          std::min_element(low, high, [](const Turn& a, const Turn& b) { return a.owner < b.owner; });
      auto current = begin_turn;
      Index steps = 0;
      while (steps < n) {
        const Index vertex = vertex_ids[current->owner];
        if (rings.ring.size() == begin || rings.ring.back() != vertex) rings.ring.push_back(vertex);
        ++steps;
        const auto next =
            std::lower_bound(low, high, current->to, [](const Turn& turn, Index key) { return turn.from < key; });
        if (next == high || next->from != current->to) {
          rings.all_closed = false;
          break;
        }
        current = next;
        if (current == begin_turn) break;
      }
      if (steps < n) rings.all_closed = false;
      if (rings.ring.size() > begin + 1 && rings.ring.back() == rings.ring[begin]) rings.ring.pop_back();
      if (rings.ring.size() < begin + 3) rings.ring.resize(begin);
    }
    rings.start[p + 1] = static_cast<Index>(rings.ring.size());
  }
  return rings;
}

// Volume, first and second moments about the origin, area, of polygons seen from the origin inside.
Moments moments(Points vertices, Indices start, Indices ring, Stop& stop) {
  Moments sum;
  for (Index f = 0; f + 1 < start.size(); ++f) {
    const Index low = start[f];
    stop.poll(start[f + 1] - low);
    for (Index j = low + 1; j < start[f + 1] - 1; ++j) {
      const double* a = vertices[ring[low]];
      const double* b = vertices[ring[j]];
      const double* c = vertices[ring[j + 1]];
      const double ux = b[0] - a[0], uy = b[1] - a[1], uz = b[2] - a[2];
      const double vx = c[0] - a[0], vy = c[1] - a[1], vz = c[2] - a[2];
      const double nx = uy * vz - uz * vy, ny = uz * vx - ux * vz, nz = ux * vy - uy * vx;
      sum.area += 0.5 * std::sqrt(nx * nx + ny * ny + nz * nz);
      const double part = (a[0] * nx + a[1] * ny + a[2] * nz) / 6.0;
      sum.volume += part;
      for (int k = 0; k < 3; ++k) {
        sum.first[k] += part * (a[k] + b[k] + c[k]) / 4.0;
        for (int m = 0; m <= k; ++m) {
          const double total = (a[k] + b[k] + c[k]) * (a[m] + b[m] + c[m]);
          sum.second[k][m] += part * (a[k] * a[m] + b[k] * b[m] + c[k] * c[m] + total) / 20.0;
        }
      }
    }
  }
  for (int k = 0; k < 3; ++k) {
    for (int m = 0; m < k; ++m) sum.second[m][k] = sum.second[k][m];
  }
  return sum;
}

// The error of a plane at center + v is at most errors (|center| + |v| + 1); slack and products add less than
// 8 u (|center| + |v| + 1).
Misfit face_misfit(Points normals, Doubles offsets, Doubles errors, const double* center, Points vertices,
                   Indices start, Indices ring, Indices rows) {
  const auto dot = [](const double* u, const double* v) { return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]; };
  Misfit misfit;
  double error = 0.0, square = 0.0;
  for (Index f = 0; f < rows.size(); ++f) {
    const double* n = normals[rows[f]];
    const double slack = offsets[rows[f]] - dot(n, center);
    error = std::max(error, errors[rows[f]]);
    for (Index j = start[f]; j < start[f + 1]; ++j) {
      misfit.on_face = std::max(misfit.on_face, std::abs(dot(n, vertices[ring[j]]) - slack));
    }
  }
  for (Index v = 0; v < vertices.size(); ++v) square = std::max(square, dot(vertices[v], vertices[v]));
  misfit.extent = std::sqrt(square);
  misfit.blur = (error + 8.0 * 0x1p-53) * (std::sqrt(dot(center, center)) + misfit.extent + 1.0);
  return misfit;
}

// Signed solid angle of triangles seen from the origin (van Oosterom and Strackee 1983).
double solid_angle(Points vertices, Indices ring, Stop& stop) {
  double total = 0.0;
  for (Index f = 0; f < ring.size() / 3; ++f) {
    stop.poll(4);
    const double* a = vertices[ring[3 * f]];
    const double* b = vertices[ring[3 * f + 1]];
    const double* c = vertices[ring[3 * f + 2]];
    const auto dot = [](const double* u, const double* v) { return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]; };
    const double la = std::sqrt(dot(a, a)), lb = std::sqrt(dot(b, b)), lc = std::sqrt(dot(c, c));
    const double triple =
        a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0]);
    const double below = la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb;
    total += 2.0 * std::atan2(triple, below);
  }
  return total;
}

}  // namespace voxkernel
