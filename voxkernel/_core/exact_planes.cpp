#include "exact_planes.h"

#include <algorithm>
#include <cmath>

namespace voxkernel {

int PlaneLattice::lowest() const {
  int lowest = cube_exponent;
  const auto look = [&](double value) {
    if (value != 0.0 && bits_of(value).exponent < lowest) lowest = std::min(lowest, lowest_bit(value));
  };
  for (Index i = 0; i < source.center.size(); ++i) {
    for (int k = 0; k < 3; ++k) look(source.center(i, k));
  }
  for (const std::int32_t row : rows) {
    const Index* corners = source.corners[row];
    if (corners[0] < 0) continue;
    for (int j = 0; j < 3; ++j) {
      for (int k = 0; k < 3; ++k) look(source.vertices(corners[j], k));
    }
  }
  return lowest;
}

ExactPlanes::ExactPlanes(const PlaneLattice& lattice)
    : lattice_(lattice), source_(lattice.source), rows_(lattice.rows) {}

void ExactPlanes::find_center() {
  shift_ = lattice_.shift();
  for (int k = 0; k < 3; ++k) {
    Wide total;
    for (Index i = 0; i < source_.center.size(); ++i) {
      total = sum(scratch_, total, from_double(scratch_, source_.center(i, k), shift_));
    }
    center_[k] = keep(total, own_);
  }
  scratch_.forget();
  has_center_ = true;
}

Wide ExactPlanes::keep(const Wide& value, LimbPool& pool) {
  if (value.size == 0) return {};
  std::uint64_t* limbs = pool.take(value.size);
  std::copy(value.limbs, value.limbs + value.size, limbs);
  return {limbs, value.size, value.sign};
}

// After every answer: numbers in between go, and planes once they are many.
void ExactPlanes::forget() {
  scratch_.forget();
  if (planes_.size() <= kMost) return;
  planes_.clear();
  kept_.forget();
}

const ExactPlanes::Plane& ExactPlanes::plane(Index i) {
  if (!has_center_) find_center();
  const auto [place, is_new] = planes_.try_emplace(i);
  Plane& found = place->second;
  if (!is_new) return found;
  if (i >= rows_.size()) {
    const Index side = i - rows_.size();
    found.n[side / 2] = keep(from_double(scratch_, side % 2 == 0 ? 1.0 : -1.0, 0), kept_);
    found.s = keep(from_double(scratch_, 1.0, lattice_.cube_exponent + shift_), kept_);
  } else if (source_.corners(rows_[i], 0) < 0) {
    from_given(source_.given[-1 - source_.corners(rows_[i], 0)], found);
  } else {
    from_corners(source_.corners[rows_[i]], found);
  }
  return found;
}

// n = (b - a) x (c - a), s = n . (a - centre).
void ExactPlanes::from_corners(const Index* corners, Plane& plane) {
  Wide at[3][3], u[3], v[3];
  for (int j = 0; j < 3; ++j) {
    for (int k = 0; k < 3; ++k) at[j][k] = from_double(scratch_, source_.vertices(corners[j], k), shift_);
  }
  for (int k = 0; k < 3; ++k) {
    u[k] = difference(scratch_, at[1][k], at[0][k]);
    v[k] = difference(scratch_, at[2][k], at[0][k]);
  }
  Wide slack;
  for (int k = 0; k < 3; ++k) {
    const int x = (k + 1) % 3, y = (k + 2) % 3;
    plane.n[k] = keep(difference_of_products(scratch_, u[x], v[y], u[y], v[x]), kept_);
    slack = sum(scratch_, slack, product(scratch_, plane.n[k], difference(scratch_, at[0][k], center_[k])));
  }
  plane.s = keep(slack, kept_);
}

// n . x <= d times the power of two that makes n, and d in lattice units, integers.
void ExactPlanes::from_given(const double* row, Plane& plane) {
  int up = -4096;
  for (int k = 0; k < 3; ++k) {
    if (row[k] != 0.0) up = std::max(up, -lowest_bit(row[k]));
  }
  if (row[3] != 0.0) up = std::max(up, -lowest_bit(row[3]) - shift_);
  Wide slack = from_double(scratch_, row[3], up + shift_);
  for (int k = 0; k < 3; ++k) {
    plane.n[k] = keep(from_double(scratch_, row[k], up), kept_);
    slack = difference(scratch_, slack, product(scratch_, plane.n[k], center_[k]));
  }
  plane.s = keep(slack, kept_);
}

Wide ExactPlanes::determinant(const Wide& ab, const Wide& ac, const Wide& bc, const Wide& a, const Wide& b,
                              const Wide& c) {
  // Rows a, b, c; ab, ac, bc are the minors of their first two columns, a, b, c their third.
  const Wide first = difference(scratch_, product(scratch_, ab, c), product(scratch_, ac, b));
  return sum(scratch_, first, product(scratch_, bc, a));
}

int ExactPlanes::normals_sign(Index i, Index j, Index k) {
  const Plane &a = plane(i), &b = plane(j), &c = plane(k);
  const auto minor = [&](const Plane& p, const Plane& q) {
    return difference_of_products(scratch_, p.n[0], q.n[1], p.n[1], q.n[0]);
  };
  const int sign = determinant(minor(a, b), minor(a, c), minor(b, c), a.n[2], b.n[2], c.n[2]).sign;
  forget();
  return sign;
}

// Whether four facets meet in a vertex of the surface: then their planes do.
bool ExactPlanes::have_common_corner(Index i, Index j, Index k, Index l) const {
  const Index others[3] = {j, k, l};
  if (std::max({i, j, k, l}) >= rows_.size()) return false;
  for (int a = 0; a < 3; ++a) {
    const Index corner = source_.corners(rows_[i], a);
    if (source_.corners(rows_[i], 0) < 0) return false;
    bool is_common = true;
    for (const Index other : others) {
      const Index* row = source_.corners[rows_[other]];
      is_common = is_common && row[0] >= 0 && (row[0] == corner || row[1] == corner || row[2] == corner);
    }
    if (is_common) return true;
  }
  return false;
}

int ExactPlanes::planes_sign(Index i, Index j, Index k, Index l) {
  if (have_common_corner(i, j, k, l)) return 0;
  const Plane* rows[4] = {&plane(i), &plane(j), &plane(k), &plane(l)};
  Wide minors[4][4];
  for (int p = 0; p < 4; ++p) {
    for (int q = p + 1; q < 4; ++q) {
      minors[p][q] = difference_of_products(scratch_, rows[p]->n[0], rows[q]->n[1], rows[p]->n[1], rows[q]->n[0]);
    }
  }
  // Along the last column: the sign of the cofactor of row r is + for r = 1 and 3, counted from 0.
  Wide total;
  for (int r = 0; r < 4; ++r) {
    int o[3], n = 0;
    for (int p = 0; p < 4; ++p) {
      if (p != r) o[n++] = p;
    }
    const Wide cofactor = determinant(minors[o[0]][o[1]], minors[o[0]][o[2]], minors[o[1]][o[2]], rows[o[0]]->n[2],
                                      rows[o[1]]->n[2], rows[o[2]]->n[2]);
    const Wide term = product(scratch_, cofactor, rows[r]->s);
    total = sum(scratch_, total, r % 2 == 1 ? term : -term);
  }
  forget();
  return total.sign;
}

bool ExactPlanes::are_same(Index i, Index j) {
  const Plane &a = plane(i), &b = plane(j);
  bool same = true;
  for (int k = 0; k < 3 && same; ++k) same = difference_of_products(scratch_, a.n[k], b.s, b.n[k], a.s).sign == 0;
  forget();
  return same;
}

int ExactPlanes::slack_sign(Index i) {
  const int sign = plane(i).s.sign;
  forget();
  return sign;
}

void ExactPlanes::dual(Index i, double scale, double* q) {
  const Plane& a = plane(i);
  const Rounded slack = rounded(a.s);
  for (int k = 0; k < 3; ++k) q[k] = scale * quotient(rounded(a.n[k]), slack, shift_);
  forget();
}

// Cramer's rule: the sum of s_i times the cross product of the other two normals, over the determinant.
void ExactPlanes::common_point(Index i, Index j, Index k, double scale, double* point) {
  const Plane* rows[3] = {&plane(i), &plane(j), &plane(k)};
  Wide top[3], below;
  for (int r = 0; r < 3; ++r) {
    const Plane &a = *rows[(r + 1) % 3], &b = *rows[(r + 2) % 3];
    for (int m = 0; m < 3; ++m) {
      const int x = (m + 1) % 3, y = (m + 2) % 3;
      const Wide cross = difference_of_products(scratch_, a.n[x], b.n[y], a.n[y], b.n[x]);
      top[m] = sum(scratch_, top[m], product(scratch_, cross, rows[r]->s));
      if (r == 0) below = sum(scratch_, below, product(scratch_, cross, rows[0]->n[m]));
    }
  }
  const Rounded determinant = rounded(below);
  for (int m = 0; m < 3; ++m) point[m] = quotient(rounded(top[m]), determinant, -shift_) / scale;
  forget();
}

}  // namespace voxkernel
