#include "dual_points.h"

#include <algorithm>
#include <atomic>
#include <limits>
#include <stdexcept>
#include <utility>

#include "workers.h"

namespace voxkernel {
namespace {

constexpr double kUnit = 0x1p-53;
constexpr double kExactDual = 0x1p-48;   // bound on the relative error of dual points made from integers
constexpr double kGoodDual = 0x1p-44;    // dual points less certain than this are made from integers
constexpr double kUnderflow = 0x1p-600;  // more than what underflow can cost a product of three numbers
constexpr double kCells = 1024.0;
constexpr Index kLeast = 1 << 13;  // points that are worth a thread

struct Keyed {
  std::uint32_t key;
  std::int32_t row;
};

// A bound on the error of `determinant` for vectors of 1-norms l whose 1-norms are off by at most e: what moving the
// vectors changes, as |det| <= the product of 1-norms, and its own rounding, less than 8 u of that product.
double determinant_error(const double (&l)[3], const double (&e)[3]) {
  const double wide = (l[0] + e[0]) * (l[1] + e[1]) * (l[2] + e[2]);
  return (wide - l[0] * l[1] * l[2]) * (1.0 + 16.0 * kUnit) + 32.0 * kUnit * wide + kUnderflow;
}

// Bits of a number spread out, so that two of them can be woven into one key.
std::uint32_t spread(std::uint32_t x) {
  x = (x | x << 8) & 0x00ff00ffu;
  x = (x | x << 4) & 0x0f0f0f0fu;
  x = (x | x << 2) & 0x33333333u;
  return (x | x << 1) & 0x55555555u;
}

// The side of a cube that a direction meets, and a cell of it, along a curve that stays near.
std::uint32_t key_of(const double* n) {
  int axis = 0;
  for (int k = 1; k < 3; ++k) {
    if (std::abs(n[k]) > std::abs(n[axis])) axis = k;
  }
  const double inverse = 1.0 / std::abs(n[axis]);
  const auto cell = [&](double value) {
    const double place = (value * inverse + 1.0) * (0.5 * kCells);
    return static_cast<std::uint32_t>(place > 0.0 ? std::min(place, kCells - 1.0) : 0.0);
  };
  const std::uint32_t woven = spread(cell(n[(axis + 1) % 3])) | spread(cell(n[(axis + 2) % 3])) << 1;
  return static_cast<std::uint32_t>(axis + (n[axis] > 0.0 ? 0 : 3)) << 20 | woven;
}

// By keys, the lower half of their bits first; rows of one key stay in order. Threads have stretches of what is sorted,
// and know where in each bucket theirs begin.
void sort_keys(Brief<Keyed>& order, int threads, Stop& stop) {
  constexpr int kBits = (kKeyBits + 1) / 2;
  constexpr std::uint32_t kMask = (1u << kBits) - 1;
  const auto n = static_cast<Index>(order.size());
  const int n_parts = worth_threads(n, kLeast, threads);
  Brief<Keyed> other(order.size());
  std::vector<std::vector<std::int32_t>> begin(n_parts);
  for (const int shift : {0, kBits}) {
    const auto each = [&](int part, auto&& visit) {
      const Index last = part_begin(n, n_parts, part + 1);
      for (Index i = part_begin(n, n_parts, part); i < last; ++i) visit(order[i], order[i].key >> shift & kMask);
    };
    run_parts(n_parts, stop, [&](int part, Stop& own) {
      begin[part].assign(kMask + 1, 0);
      each(part, [&](const Keyed&, std::uint32_t bucket) { ++begin[part][bucket]; });
      own.poll(n / n_parts);
    });
    std::int32_t sum = 0;
    for (std::uint32_t bucket = 0; bucket <= kMask; ++bucket) {
      for (std::vector<std::int32_t>& part : begin) {
        const std::int32_t count = part[bucket];
        part[bucket] = sum;
        sum += count;
      }
    }
    run_parts(n_parts, stop, [&](int part, Stop& own) {
      each(part, [&](const Keyed& one, std::uint32_t bucket) { other[begin[part][bucket]++] = one; });
      own.poll(n / n_parts);
    });
    order.swap(other);
  }
}

}  // namespace

void sort_rows(const LocalPlanes& planes, Indices rows, DualPoints& found, int threads, Stop& stop) {
  if (planes.offsets.size() > std::numeric_limits<std::int32_t>::max() / 2 - 64) {
    throw std::length_error("a dual hull takes fewer than 2**30 half-spaces");
  }
  const Index n = rows.size();
  found.rows.resize(n);
  if (n <= kSorted) {
    std::transform(rows.begin(), rows.end(), found.rows.begin(), [](Index i) { return static_cast<std::int32_t>(i); });
    return;
  }
  Brief<Keyed> order(n);
  run_stretches(n, kLeast, threads, stop, [&](Index first, Index last, Stop& own) {
    for (Index i = first; i < last; ++i) {
      own.poll(4);
      order[i] = {key_of(planes.normals[rows[i]]), static_cast<std::int32_t>(rows[i])};
    }
  });
  sort_keys(order, threads, stop);
  found.keys.resize(n);
  run_stretches(n, kLeast, threads, stop, [&](Index first, Index last, Stop& own) {
    own.poll(last - first);
    for (Index i = first; i < last; ++i) {
      found.rows[i] = order[i].row;
      found.keys[i] = order[i].key;
    }
  });
}

PointMaker::PointMaker(const LocalPlanes& planes, const DualPoints& duals, const PlaneLattice& lattice)
    : planes_(planes), duals_(duals), exact_(lattice) {
  const double* center = planes.center;
  reach_ = std::sqrt(center[0] * center[0] + center[1] * center[1] + center[2] * center[2]) + 1.0;
}

// |n / s - n* / s*| <= |n / s| (e + 3 u + ds / (s - ds)) with |n - n*| <= e and |s - s*| <= ds, |n| about 1.
bool PointMaker::make(std::int32_t place, DualPoint& point) {
  const Index row = duals_.rows[place];
  const double* m = planes_.normals[row];
  const double* center = planes_.center;
  const double slack = planes_.offsets[row] - (m[0] * center[0] + m[1] * center[1] + m[2] * center[2]);
  const double e = planes_.errors[row];
  const double slack_error = (e + 8.0 * kUnit) * reach_ + planes_.center_error;
  double share = std::numeric_limits<double>::infinity();
  if (slack > 2.0 * slack_error) share = 1.01 * (e + slack_error / (slack - slack_error)) + 4.0 * kUnit;
  if (share <= kGoodDual) {
    for (int k = 0; k < 3; ++k) point.q[k] = m[k] / slack;
  } else {
    if (exact_.slack_sign(place) <= 0) return false;
    exact_.dual(place, planes_.scale, point.q);
    share = kExactDual;
  }
  point.error = 1.01 * share * size_of(point.q);
  return true;
}

bool find_points(const LocalPlanes& planes, const PlaneLattice& lattice, DualPoints& found, int threads, Stop& stop) {
  const Index n = found.size();
  found.points.resize(n + 6);
  std::atomic<bool> is_inside{true};
  run_stretches(n, kLeast, threads, stop, [&](Index first, Index last, Stop& own) {
    PointMaker maker(planes, found, lattice);
    for (Index i = first; i < last; ++i) {
      own.poll(4);
      if (!maker.make(static_cast<std::int32_t>(i), found.points[i])) {
        is_inside = false;
        return;
      }
    }
  });
  const int cube_exponent = lattice.cube_exponent;
  // Local units: the cube has half edge 2**cube_exponent in units of the world.
  const double far = planes.scale * std::ldexp(1.0, -std::min(cube_exponent, 1000));
  for (int side = 0; side < 6; ++side) {
    DualPoint& point = found.points[n + side];
    point = {{0.0, 0.0, 0.0}, cube_exponent <= 1000 ? 0.0 : far};
    if (cube_exponent <= 1000) point.q[side / 2] = side % 2 == 0 ? far : -far;
  }
  return is_inside;
}

int DualSigns::beyond(std::int32_t i, std::int32_t j, std::int32_t k, std::int32_t l) {
  const DualPoint &a = points_[i], &b = points_[j], &c = points_[k], &d = points_[l];
  const double u[3] = {a.q[0] - d.q[0], a.q[1] - d.q[1], a.q[2] - d.q[2]};
  const double v[3] = {b.q[0] - d.q[0], b.q[1] - d.q[1], b.q[2] - d.q[2]};
  const double w[3] = {c.q[0] - d.q[0], c.q[1] - d.q[1], c.q[2] - d.q[2]};
  const double value = determinant(u, v, w);
  const double lengths[3] = {size_of(u), size_of(v), size_of(w)};
  // Each coordinate of a difference is off by the errors of both points, and u of itself.
  const double errors[3] = {3.0 * (a.error + d.error) + kUnit * lengths[0],
                            3.0 * (b.error + d.error) + kUnit * lengths[1],
                            3.0 * (c.error + d.error) + kUnit * lengths[2]};
  const double error = determinant_error(lengths, errors);
  if (value > error) return -1;
  if (value < -error) return 1;
  return -exact.planes_sign(i, j, k, l);
}

int rounded_side(const DualPoint& a, const DualPoint& b, const DualPoint& c) {
  const double value = determinant(a.q, b.q, c.q);
  const double lengths[3] = {size_of(a.q), size_of(b.q), size_of(c.q)};
  const double errors[3] = {3.0 * a.error, 3.0 * b.error, 3.0 * c.error};
  const double error = determinant_error(lengths, errors);
  return value > error ? 1 : value < -error ? -1 : 2;
}

int DualSigns::side(std::int32_t i, std::int32_t j, std::int32_t k) {
  const int sign = rounded_side(i, j, k);
  return sign == 2 ? exact.normals_sign(i, j, k) : sign;
}

}  // namespace voxkernel
