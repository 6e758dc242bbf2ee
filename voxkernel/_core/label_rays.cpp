#include "label_rays.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "bits.h"

namespace voxkernel {
namespace {

constexpr double kFar = std::numeric_limits<double>::infinity();
constexpr Index kBits = 64;
constexpr Index kSmall = Index{1} << 20;  // voxels, for which two bytes each do no harm
constexpr int kMostBits = 16;             // behind the binary point of an end, in voxels
constexpr int kLongest = 29;              // bits of an end: sums of two products of differences fit in 64

double exact_length(const Crop& crop, const Index* center, const double* u, Index& n_steps) {
  double half[3], next[3];
  Index step[3], n[3] = {0, 0, 0};
  for (int a = 0; a < 3; ++a) {
    half[a] = u[a] == 0.0 ? kFar : 0.5 / std::abs(u[a]);
    next[a] = half[a];
    step[a] = u[a] < 0.0 ? -crop.stride(a) : crop.stride(a);
  }
  Index at = crop.flat(center[0], center[1], center[2]);
  double t = 0.0;
  while (crop.bytes[at] != 0) {
    ++n_steps;
    t = std::min(next[0], std::min(next[1], next[2]));
    for (int a = 0; a < 3; ++a) {
      if (next[a] != t) continue;
      at += step[a];
      ++n[a];
      next[a] = half[a] * static_cast<double>(2 * n[a] + 1);
    }
  }
  return t;
}

double stepped_length(const Crop& crop, const Index* center, const double* u, Index& n_steps) {
  const double length = std::sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2]);
  const double d[3] = {u[0] / length, u[1] / length, u[2] / length};
  for (Index k = 1;; ++k) {
    ++n_steps;
    Index at[3];
    for (int a = 0; a < 3; ++a) at[a] = center[a] + static_cast<Index>(std::round(static_cast<double>(k) * d[a]));
    if (crop.bytes[crop.flat(at[0], at[1], at[2])] != 0) continue;
    if (crop.is_flat) {
      return (static_cast<double>(k) - 1.0 + 0.5 / std::max(std::abs(d[1]), std::abs(d[2]))) / length;
    }
    double square = 0.0;
    for (int a = 0; a < 3; ++a) square += static_cast<double>((at[a] - center[a]) * (at[a] - center[a]));
    return std::sqrt(square) / length;
  }
}

// An end in units of a power of two; its third coordinate as given.
struct End {
  Index i, j;
  double k;
};

// Twice the area of a, b, p in the plane of the first two axes, for points p along the second one.
class Side {
 public:
  // From p = (i, j) on, one `unit` after the other.
  Side(const End& a, const End& b, Index i, Index j, Index unit)
      : step_((b.i - a.i) * unit), twice_((b.i - a.i) * (j - a.j) - (b.j - a.j) * (i - a.i)) {
    const Index di = b.i - a.i, dj = b.j - a.j;
    is_positive_on_it_ = dj != 0 ? dj < 0 : di > 0;
  }
  void advance() { twice_ += step_; }
  Index twice() const { return twice_; }
  // Where it is 0, its sign is that for a p moved by (e, e^2) with an e smaller than any number, so that every p is on
  // one side, and an edge has two.
  bool is_positive() const { return twice_ != 0 ? twice_ > 0 : is_positive_on_it_; }

 private:
  Index step_, twice_;
  bool is_positive_on_it_;
};

// Rows are at multiples of 2**bits; numbers are moved up, so that none is below 0.
constexpr Index kUp = Index{1} << 40;
Index last_row(Index q, int bits) { return ((q + kUp) >> bits) - (kUp >> bits); }
Index first_row(Index q, int bits) { return last_row(q + (Index{1} << bits) - 1, bits); }

}  // namespace

void ray_lengths(const Crop& crop, const Index* center, Points directions, RayEnd end, Span<double> lengths,
                 Stop& stop) {
  Index n_steps = 0;
  for (Index r = 0; r < directions.size(); ++r) {
    lengths[r] = end == RayEnd::kExact ? exact_length(crop, center, directions[r], n_steps)
                                       : stepped_length(crop, center, directions[r], n_steps);
    stop.poll(n_steps);
    n_steps = 0;
  }
}

StarRaster::StarRaster(const Crop& crop) : crop_(crop) {
  const Index nk = crop.shape[2], n_rows = crop.shape[0] * crop.shape[1];
  if (crop.size() <= kSmall && nk <= UINT16_MAX) {
    before_.resize(static_cast<std::size_t>(crop.size()));
    for (Index row = 0; row < n_rows; ++row) {
      const std::uint8_t* bytes = crop.bytes.data() + row * nk;
      std::uint16_t* to = before_.data() + row * nk;
      std::uint16_t sum = 0;
      for (Index k = 0; k < nk; ++k) to[k] = sum = static_cast<std::uint16_t>(sum + (bytes[k] != 0 ? 1 : 0));
    }
    return;
  }
  n_stretches_ = (nk + kBits - 1) / kBits;
  stretches_.reserve(static_cast<std::size_t>(n_rows * n_stretches_));
  for (Index row = 0; row < n_rows; ++row) {
    const std::uint8_t* bytes = crop.bytes.data() + row * nk;
    Index sum = 0;
    for (Index first = 0; first < nk; first += kBits) {
      std::uint64_t bits = 0;
      const Index n = std::min(kBits, nk - first);
      for (Index k = 0; k < n; ++k) bits |= std::uint64_t{bytes[first + k] != 0 ? 1u : 0u} << k;
      stretches_.push_back({bits, sum});
      sum += count_bits(bits);
    }
  }
}

// Voxels of the object in a row of the crop up to and with one.
inline Index StarRaster::count_to(Index i, Index j, Index k) const {
  if (!before_.empty()) return before_[crop_.flat(i, j, k)];
  const Stretch& stretch = stretches_[(i * crop_.shape[1] + j) * n_stretches_ + k / kBits];
  return stretch.before + count_bits(stretch.bits & ~std::uint64_t{0} >> (kBits - 1 - k % kBits));
}

// The row of voxel (i, j) passes the surface at x: all voxels up to there count, once more or once less.
void StarRaster::pass(Index i, Index j, double x, bool leaves) {
  if (i < low_[0] || i > high_[0] || j < low_[1] || j > high_[1]) return;
  const double bounded = std::min(std::max(std::floor(x) + static_cast<double>(center_[2]), -0x1p40), 0x1p40);
  const Index k = std::min(std::max(static_cast<Index>(bounded), low_[2] - 1), high_[2]);
  const Index size = k - (low_[2] - 1);
  Index common = 0;
  if (i >= 0 && i < crop_.shape[0] && j >= 0 && j < crop_.shape[1] && k >= 0) {
    common = count_to(i, j, std::min(k, crop_.shape[2] - 1));
  }
  count_.size += leaves ? size : -size;
  count_.common += leaves ? common : -common;
}

// The volume below a surface along the last axis, a sum over its triangles; here in voxels.
StarCount StarRaster::count(const Index* center, Points ends, Triangles faces, const Index* low, const Index* high,
                            Stop& stop) {
  double largest = 1.0;
  for (int a = 0; a < 3; ++a) {
    center_[a] = center[a];
    low_[a] = low[a];
    high_[a] = high[a];
  }
  for (Index e = 0; e < ends.size(); ++e) {
    largest = std::max(largest, std::max(std::abs(ends(e, 0)), std::abs(ends(e, 1))));
  }
  const int bits = std::max(0, std::min(kMostBits, kLongest - 1 - std::ilogb(largest)));
  const Index unit = Index{1} << bits;
  const double scale = static_cast<double>(unit);
  std::vector<End> fixed(static_cast<std::size_t>(ends.size()));
  for (Index e = 0; e < ends.size(); ++e) {
    fixed[e] = {std::llround(ends(e, 0) * scale), std::llround(ends(e, 1) * scale), ends(e, 2)};
  }
  count_ = {};
  if (crop_.is_flat) {
    for (Index e = 0; e < ends.size(); ++e) {
      const End &a = fixed[e], &b = fixed[e + 1 < ends.size() ? e + 1 : 0];
      if (a.j == b.j) continue;
      const bool rises = b.j > a.j;
      // A row on an end belongs to the edge above it.
      const Index first = first_row(std::min(a.j, b.j), bits), last = last_row(std::max(a.j, b.j) - 1, bits);
      for (Index j = first; j <= last; ++j) {
        const double share = static_cast<double>(j * unit - a.j) / static_cast<double>(b.j - a.j);
        pass(center_[0], center_[1] + j, a.k + share * (b.k - a.k), rises);
      }
      stop.poll(1 + std::max<Index>(0, last - first));
    }
    // Rising edges leave where angles grow from the second axis to the first, else they enter.
    if (count_.size < 0) count_ = {-count_.size, -count_.common};
    return count_;
  }
  for (Index f = 0; f < faces.size(); ++f) {
    const End &a = fixed[faces(f, 0)], &b = fixed[faces(f, 1)], &c = fixed[faces(f, 2)];
    const Index twice = Side(a, b, c.i, c.j, unit).twice();
    if (twice == 0) continue;  // no row passes it, wherever the rows are moved by however little
    const Index low_i = first_row(std::min({a.i, b.i, c.i}), bits), high_i = last_row(std::max({a.i, b.i, c.i}), bits);
    const Index low_j = first_row(std::min({a.j, b.j, c.j}), bits), high_j = last_row(std::max({a.j, b.j, c.j}), bits);
    const bool leaves = twice > 0;
    const double inverse = 1.0 / static_cast<double>(twice);
    for (Index i = low_i; i <= high_i; ++i) {
      Side ab(a, b, i * unit, low_j * unit, unit), bc(b, c, i * unit, low_j * unit, unit);
      Side ca(c, a, i * unit, low_j * unit, unit);
      for (Index j = low_j; j <= high_j; ++j, ab.advance(), bc.advance(), ca.advance()) {
        if (ab.is_positive() != leaves || bc.is_positive() != leaves || ca.is_positive() != leaves) continue;
        const double x = (static_cast<double>(bc.twice()) * a.k + static_cast<double>(ca.twice()) * b.k +
                          static_cast<double>(ab.twice()) * c.k) *
                         inverse;
        pass(center_[0] + i, center_[1] + j, x, leaves);
      }
      stop.poll(1 + high_j - low_j);
    }
  }
  return count_;
}

}  // namespace voxkernel
