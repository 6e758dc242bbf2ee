#include "planes.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <limits>

#include "avx2.h"
#include "shared_buckets.h"
#include "stretches.h"
#include "workers.h"

namespace voxkernel {
namespace {

constexpr double kUnitRoundoff = 0x1p-53;
// Triangles with |e1||e2| above this multiple of twice their area are left to exact arithmetic.
constexpr double kMaxSlenderness = 1e6;
// Up to this multiple, the first corner will do as the apex.
constexpr double kRoundEnough = 4.0;

// Below this product of squared lengths the arithmetic underflows.
constexpr double kTiny = 1e-270;

constexpr Index kLeast = 1 << 14;  // vertices or faces that are worth a thread

bool equal(const double* a, const double* b) { return a[0] == b[0] && a[1] == b[1] && a[2] == b[2]; }

// Where the corners and what is computed from them lie.
struct Facets {
  Points vertices;
  Triangles corners;
  const double* origin;
  double inverse_scale;
  Rows<double, 3> normals;
  Span<double> offsets, areas, errors;

  bool fill(Index i) const;
  void refuse(Index i, bool is_edge) const;
};

void Facets::refuse(Index i, bool is_edge) const {
  std::fill_n(normals[i], 3, 0.0);
  offsets[i] = 0.0;
  areas[i] = 0.0;
  errors[i] = is_edge ? -2.0 : -1.0;
}

// One plane; returns whether it is left undecided.
bool Facets::fill(Index i) const {
  const double* a = vertices[corners(i, 0)];
  const double* b = vertices[corners(i, 1)];
  const double* c = vertices[corners(i, 2)];
  // The edges c to a and a to b: a is the apex unless its angle is small or wide.
  double ux = (a[0] - c[0]) * inverse_scale, uy = (a[1] - c[1]) * inverse_scale, uz = (a[2] - c[2]) * inverse_scale;
  double vx = (b[0] - a[0]) * inverse_scale, vy = (b[1] - a[1]) * inverse_scale, vz = (b[2] - a[2]) * inverse_scale;
  const double* apex = a;
  double nx = uy * vz - uz * vy, ny = uz * vx - ux * vz, nz = ux * vy - uy * vx;
  double square = nx * nx + ny * ny + nz * nz;
  const double ca = ux * ux + uy * uy + uz * uz;
  const double ab = vx * vx + vy * vy + vz * vz;
  double product = ca * ab;
  double error = (20.0 * kRoundEnough + 8.0) * kUnitRoundoff;
  if (product < kTiny || square * (kRoundEnough * kRoundEnough) < product) {
    const double qx = (c[0] - b[0]) * inverse_scale, qy = (c[1] - b[1]) * inverse_scale,
                 qz = (c[2] - b[2]) * inverse_scale;
    const double bc = qx * qx + qy * qy + qz * qz;
    if (ab >= bc && ab >= ca) {  // c is the apex
      product = bc * ca;
      vx = ux, vy = uy, vz = uz;
      ux = qx, uy = qy, uz = qz;
      apex = c;
    } else if (ca >= bc) {  // b is the apex
      product = ab * bc;
      ux = vx, uy = vy, uz = vz;
      vx = qx, vy = qy, vz = qz;
      apex = b;
    }
    nx = uy * vz - uz * vy;
    ny = uz * vx - ux * vz;
    nz = ux * vy - uy * vx;
    square = nx * nx + ny * ny + nz * nz;
    if (square > 0.0) error = (20.0 * std::sqrt(product / square) + 8.0) * kUnitRoundoff;
  }
  if (product < kTiny || !(square * (kMaxSlenderness * kMaxSlenderness) > product)) {
    const bool is_edge = equal(a, b) || equal(a, c) || equal(b, c);
    refuse(i, is_edge);
    return !is_edge;
  }
  const double length = std::sqrt(square);
  const double inverse = 1.0 / length;
  nx *= inverse;
  ny *= inverse;
  nz *= inverse;
  normals(i, 0) = nx;
  normals(i, 1) = ny;
  normals(i, 2) = nz;
  offsets[i] = nx * ((apex[0] - origin[0]) * inverse_scale) + ny * ((apex[1] - origin[1]) * inverse_scale) +
               nz * ((apex[2] - origin[2]) * inverse_scale);
  areas[i] = 0.5 * length;
  errors[i] = error;
  return false;
}

#ifdef VOXKERNEL_HAS_AVX2

VOXKERNEL_AVX2_INLINE Columns difference(const Columns& p, const Columns& q, __m256d factor) {
  return {_mm256_mul_pd(_mm256_sub_pd(p.x, q.x), factor), _mm256_mul_pd(_mm256_sub_pd(p.y, q.y), factor),
          _mm256_mul_pd(_mm256_sub_pd(p.z, q.z), factor)};
}
VOXKERNEL_AVX2_INLINE __m256d minor(__m256d a, __m256d b, __m256d c, __m256d d) {
  return _mm256_sub_pd(_mm256_mul_pd(a, b), _mm256_mul_pd(c, d));
}
VOXKERNEL_AVX2_INLINE __m256d dot(const Columns& p, const Columns& q) {
  return _mm256_add_pd(_mm256_add_pd(_mm256_mul_pd(p.x, q.x), _mm256_mul_pd(p.y, q.y)), _mm256_mul_pd(p.z, q.z));
}
VOXKERNEL_AVX2_INLINE Columns gather(Points vertices, const Index* first) {
  const double *p = vertices[first[0]], *q = vertices[first[3]], *r = vertices[first[6]], *s = vertices[first[9]];
  return {_mm256_set_pd(s[0], r[0], q[0], p[0]), _mm256_set_pd(s[1], r[1], q[1], p[1]),
          _mm256_set_pd(s[2], r[2], q[2], p[2])};
}

// Four planes by the same operations, so with the same results, if the first corner will do as the apex of all.
VOXKERNEL_AVX2_INLINE bool fill_four(const Facets& f, Index i) {
  const Index* ids = f.corners[i];
  const Columns a = gather(f.vertices, ids), b = gather(f.vertices, ids + 1), c = gather(f.vertices, ids + 2);
  const __m256d scale = _mm256_set1_pd(f.inverse_scale);
  const Columns u = difference(a, c, scale), v = difference(b, a, scale);
  Columns n{minor(u.y, v.z, u.z, v.y), minor(u.z, v.x, u.x, v.z), minor(u.x, v.y, u.y, v.x)};
  const __m256d square = dot(n, n), product = _mm256_mul_pd(dot(u, u), dot(v, v));
  const __m256d is_slender =
      _mm256_cmp_pd(_mm256_mul_pd(square, _mm256_set1_pd(kRoundEnough * kRoundEnough)), product, _CMP_NGE_UQ);
  const __m256d is_tiny = _mm256_cmp_pd(product, _mm256_set1_pd(kTiny), _CMP_NGE_UQ);
  if (_mm256_movemask_pd(_mm256_or_pd(is_slender, is_tiny)) != 0) return false;
  const __m256d length = _mm256_sqrt_pd(square), inverse = _mm256_div_pd(_mm256_set1_pd(1.0), length);
  n = {_mm256_mul_pd(n.x, inverse), _mm256_mul_pd(n.y, inverse), _mm256_mul_pd(n.z, inverse)};
  const Columns origin{_mm256_set1_pd(f.origin[0]), _mm256_set1_pd(f.origin[1]), _mm256_set1_pd(f.origin[2])};
  store_rows_of_four(f.normals[i], n);
  _mm256_storeu_pd(f.offsets.data() + i, dot(n, difference(a, origin, scale)));
  _mm256_storeu_pd(f.areas.data() + i, _mm256_mul_pd(_mm256_set1_pd(0.5), length));
  _mm256_storeu_pd(f.errors.data() + i, _mm256_set1_pd((20.0 * kRoundEnough + 8.0) * kUnitRoundoff));
  return true;
}

VOXKERNEL_AVX2 Index fill_planes_avx2(const Facets& facets, Index first, Index last) {
  Index undecided = 0;
  for (; first + 4 <= last; first += 4) {
    if (fill_four(facets, first)) continue;
    for (Index i = first; i < first + 4; ++i) undecided += Index{facets.fill(i)};
  }
  for (; first < last; ++first) undecided += Index{facets.fill(first)};
  return undecided;
}

#endif

Index fill_planes(const Facets& facets, Index first, Index last) {
#ifdef VOXKERNEL_HAS_AVX2
  if (has_avx2) return fill_planes_avx2(facets, first, last);
#endif
  Index undecided = 0;
  for (Index i = first; i < last; ++i) undecided += Index{facets.fill(i)};
  return undecided;
}

}  // namespace

// Fills unit normals, offsets, areas and relative error bounds; returns the number left undecided.
//
// The corner opposite the longest edge is the best apex of the cross product; where the first corner is
// nearly as good, it is taken without a choice, which is what most facets need.
// `errors[i]` bounds the error of n . x - d divided by |x| + 1, for local x; it is -1 where the plane
// must be computed exactly and -2 where two corners coincide (no area).
// Bound: an edge has relative error u, a cross product of edges 7 u |e1||e2|, its direction twice that
// over |e1 x e2|; the dot products add less than 8 u (|x| + 1).
Index facet_planes(Points vertices, Triangles corners, const double* origin, double inverse_scale,
                   Rows<double, 3> normals, Span<double> offsets, Span<double> areas, Span<double> errors, Stop& stop) {
  const Facets facets{vertices, corners, origin, inverse_scale, normals, offsets, areas, errors};
  constexpr Index stretch = 1 << 10;
  Index undecided = 0;
  for (Index first = 0; first < corners.size(); first += stretch) {
    const Index last = std::min(corners.size(), first + stretch);
    undecided += fill_planes(facets, first, last);
    stop.poll(last - first);
  }
  return undecided;
}

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr int kMostParts = 8;  // each marks the vertices that it has seen

void widen(Box& box, const Box& other) {
  for (int k = 0; k < 3; ++k) {
    box.low[k] = std::min(box.low[k], other.low[k]);
    box.high[k] = std::max(box.high[k], other.high[k]);
  }
  box.smallest = std::min(box.smallest, other.smallest);
}

Box range_of(Points vertices, Index first, Index last, const std::vector<std::vector<char>>& used, Stop& stop) {
  Box box{{kInfinity, kInfinity, kInfinity}, {-kInfinity, -kInfinity, -kInfinity}, kInfinity};
  for_each(last - first, 1, stop, [&](Index i) {
    const bool is_used = std::any_of(used.begin(), used.end(), [&](const auto& seen) { return seen[first + i] != 0; });
    if (!is_used) return;
    for (int k = 0; k < 3; ++k) {
      const double v = vertices(first + i, k);
      box.low[k] = std::min(box.low[k], v);
      box.high[k] = std::max(box.high[k], v);
      const double size = std::abs(v);
      if (size > 0.0 && size < box.smallest) box.smallest = size;
    }
  });
  return box;
}

// Of the vertices that rows of some tables refer to.
Box range_of_used(Points vertices, std::initializer_list<Triangles> tables, int threads, Stop& stop) {
  const Index most =
      std::max(tables, [](const Triangles& a, const Triangles& b) { return a.size() < b.size(); }).size();
  const int n_parts = worth_threads(most, kLeast, std::min(threads, kMostParts));
  std::vector<std::vector<char>> used(n_parts);
  run_parts(n_parts, stop, [&](int part, Stop& own) {
    used[part].assign(vertices.size(), 0);
    for (const Triangles& rows : tables) {
      const Index first = part_begin(rows.size(), n_parts, part), last = part_begin(rows.size(), n_parts, part + 1);
      for_each(last - first, 1, own, [&](Index i) {
        for (int k = 0; k < 3; ++k) used[part][rows(first + i, k)] = 1;
      });
    }
  });
  std::vector<Box> boxes(n_parts);
  run_parts(n_parts, stop, [&](int part, Stop& own) {
    boxes[part] = range_of(vertices, part_begin(vertices.size(), n_parts, part),
                           part_begin(vertices.size(), n_parts, part + 1), used, own);
  });
  for (const Box& box : boxes) widen(boxes[0], box);
  return boxes[0];
}

PlaneFrame frame_of(const Box& box) {
  PlaneFrame frame{};
  frame.smallest = box.smallest;
  double square = 0.0;
  for (int k = 0; k < 3; ++k) {
    const double low = box.low[k], high = box.high[k];
    frame.span[k] = high - low;
    frame.largest = std::max({frame.largest, std::abs(low), std::abs(high)});
    frame.origin[k] = low + 0.5 * frame.span[k];
    const double half = std::max(high - frame.origin[k], frame.origin[k] - low);
    square += half * half;
  }
  // The smallest power of two that is at least the radius, with room for its rounding.
  int exponent = 0;
  const double mantissa = std::frexp(std::sqrt(square) * (1.0 + 1e-12), &exponent);
  frame.scale = mantissa == 0.0 ? 1.0 : std::ldexp(1.0, mantissa == 0.5 ? exponent - 1 : exponent);
  return frame;
}

}  // namespace

// The bounding box of the vertices that faces refer to, and their smallest magnitude but zero.
Box coordinate_range(Points vertices, Triangles faces, int threads, Stop& stop) {
  return range_of_used(vertices, {faces}, threads, stop);
}

PlaneFrame plane_frame(Points vertices, Triangles faces, Stop& stop) {
  return frame_of(coordinate_range(vertices, faces, 1, stop));
}

MeshPlanes mesh_planes(Points vertices, Triangles faces, Triangles corners, int threads, Stop& stop) {
  MeshPlanes found;
  const bool is_one_table = corners.data() == faces.data();
  found.frame = frame_of(is_one_table ? range_of_used(vertices, {faces}, threads, stop)
                                      : range_of_used(vertices, {faces, corners}, threads, stop));
  found.bounds_volume = boundary_is_zero(faces, vertices.size(), threads, stop);
  const Index n = corners.size();
  found.normals.resize(3 * n);
  for (UnfilledVector<double>* numbers : {&found.offsets, &found.areas, &found.errors}) numbers->resize(n);
  const double scale = found.frame.scale;
  std::atomic<Index> undecided{0}, refused{0};
  run_stretches(n, kLeast, threads, stop, [&](Index first, Index last, Stop& own) {
    const auto part = [&](UnfilledVector<double>& numbers) { return Span<double>(numbers).part(first, last); };
    const Span<double> areas = part(found.areas), errors = part(found.errors);
    undecided += facet_planes(vertices, {corners[first], last - first}, found.frame.origin, 1.0 / scale,
                              {&found.normals[3 * first], last - first}, part(found.offsets), areas, errors, own);
    Index without = 0;
    for (Index i = 0; i < areas.size(); ++i) {
      areas[i] *= scale * scale;
      without += Index{errors[i] < 0.0};
    }
    refused += without;
  });
  found.undecided = undecided;
  found.refused = refused;
  return found;
}

double least_spread(Points normals, Index step, Stop& stop) {
  double xx = 0.0, xy = 0.0, xz = 0.0, yy = 0.0, yz = 0.0, zz = 0.0;
  Index count = 0;
  for (Index i = 0; i < normals.size(); i += step, ++count) {
    stop.poll();
    const double* n = normals[i];
    xx += n[0] * n[0];
    xy += n[0] * n[1];
    xz += n[0] * n[2];
    yy += n[1] * n[1];
    yz += n[1] * n[2];
    zz += n[2] * n[2];
  }
  // The product of the eigenvalues; two of them have a product of at most (trace / 2)^2 = 1/4.
  const double determinant = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz);
  const double total = static_cast<double>(count);
  return 4.0 * determinant / (total * total * total);
}

namespace {

// `Small` holds twice the vertices, and all half-edges.
template <typename Small>
bool boundary_is_zero_with(Triangles faces, Index n_vertices, int threads, Stop& stop) {
  const auto each_edge = [&](Index first, Index last, Stop& own, auto&& put) {
    for_each(last - first, 1, own, [&](Index i) {
      const Index* face = faces[first + i];
      for (int k = 0; k < 3; ++k) {
        const Index a = face[k], b = face[k == 2 ? 0 : k + 1];
        if (a != b) put(std::min(a, b), [&] { return static_cast<Small>(a < b ? 2 * b : 2 * a + 1); });
      }
    });
  };
  SharedBuckets<Small, Small> buckets(n_vertices, faces.size(), kLeast, threads, stop, each_edge);
  std::atomic<bool> is_balanced{true};
  buckets.for_each_bucket(stop, [&](Small* keys, Index n) {
    std::sort(keys, keys + n);
    for (Index i = 0; i < n;) {
      const Small other = keys[i] / 2;
      Index balance = 0;
      for (; i < n && keys[i] / 2 == other; ++i) balance += keys[i] % 2 == 0 ? 1 : -1;
      if (balance != 0) is_balanced = false;
    }
    return is_balanced.load(std::memory_order_relaxed);
  });
  return is_balanced;
}

}  // namespace

// Whether every edge is traversed equally often in both directions: the surface bounds a volume.
// Edges are bucketed by their smaller vertex, so the time is linear; nothing is hashed.
bool boundary_is_zero(Triangles faces, Index n_vertices, int threads, Stop& stop) {
  const bool is_small = std::max(2 * n_vertices + 1, 3 * faces.size()) <= Index{UINT32_MAX};
  return is_small ? boundary_is_zero_with<std::uint32_t>(faces, n_vertices, threads, stop)
                  : boundary_is_zero_with<std::uint64_t>(faces, n_vertices, threads, stop);
}

}  // namespace voxkernel
