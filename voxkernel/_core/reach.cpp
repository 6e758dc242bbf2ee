#include "reach.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "workers.h"

namespace voxkernel {
namespace {

constexpr double kUnitRoundoff = 0x1p-53;
constexpr Index kLeafCorners = 8;
constexpr Index kLeast = 1 << 14;  // planes or corners that are worth a thread

double dot(const double* n, const double* v) { return n[0] * v[0] + n[1] * v[1] + n[2] * v[2]; }

float below(double value) {
  const auto near = static_cast<float>(value);
  return near <= value ? near : std::nextafter(near, -std::numeric_limits<float>::infinity());
}

float above(double value) { return -below(-value); }

}  // namespace

CornerTree::CornerTree(Points corners, int threads, Stop& stop)
    : corners_(corners.data(), corners.data() + 3 * corners.size()) {
  if (corners.size() > std::numeric_limits<std::int32_t>::max()) throw std::length_error("too many corners");
  nodes_.reserve(static_cast<std::size_t>(corners.size() / 3 + 1));
  build(0, corners.size(), nodes_, threads, stop);
}

// Depth first: a node is followed by its lower half, and `skip` jumps over all that is below it.
void CornerTree::build(Index first, Index last, std::vector<Node>& nodes, int threads, Stop& stop) {
  stop.poll(last - first);
  constexpr double infinity = std::numeric_limits<double>::infinity();
  double low[3] = {infinity, infinity, infinity}, high[3] = {-infinity, -infinity, -infinity};
  for (Index i = first; i < last; ++i) {
    for (int k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], corners_[3 * i + k]);
      high[k] = std::max(high[k], corners_[3 * i + k]);
    }
  }
  const std::size_t at = nodes.size();
  nodes.push_back({{below(low[0]), below(low[1]), below(low[2])},
                   {above(high[0]), above(high[1]), above(high[2])},
                   static_cast<std::int32_t>(first),
                   static_cast<std::int32_t>(last),
                   0});
  if (last - first > kLeafCorners) {
    int axis = 0;
    for (int k = 1; k < 3; ++k) {
      if (high[k] - low[k] > high[axis] - low[axis]) axis = k;
    }
    auto* rows = reinterpret_cast<std::array<double, 3>*>(corners_.data());
    const Index middle = first + (last - first) / 2;
    std::nth_element(rows + first, rows + middle, rows + last,
                     [axis](const auto& a, const auto& b) { return a[axis] < b[axis]; });
    if (threads > 1 && last - first > kLeast) {
      std::vector<Node> upper;
      run_parts(2, stop, [&](int part, Stop& own) {
        if (part == 0) {
          build(first, middle, nodes, threads / 2, own);
        } else {
          build(middle, last, upper, threads - threads / 2, own);
        }
      });
      const auto shift = static_cast<std::int32_t>(nodes.size());
      for (Node& node : upper) {
        node.skip += shift;
        nodes.push_back(node);
      }
    } else {
      build(first, middle, nodes, 1, stop);
      build(middle, last, nodes, 1, stop);
    }
  }
  nodes[at].skip = static_cast<std::int32_t>(nodes.size());
}

bool CornerTree::reaches(const double* normal, double floor) const {
  const auto end = static_cast<std::int32_t>(nodes_.size());
  for (std::int32_t at = 0; at < end;) {
    const Node& node = nodes_[at];
    const float* x = normal[0] > 0.0 ? node.high : node.low;
    const float* y = normal[1] > 0.0 ? node.high : node.low;
    const float* z = normal[2] > 0.0 ? node.high : node.low;
    // Rounded like the products below, and each term is not smaller: never below what a corner gives, or not a number.
    if (normal[0] * x[0] + normal[1] * y[1] + normal[2] * z[2] <= floor) {
      at = node.skip;
      continue;
    }
    if (node.skip == at + 1) {
      for (Index i = node.first; i < node.last; ++i) {
        if (dot(normal, &corners_[3 * i]) > floor) return true;
      }
    }
    ++at;
  }
  return false;
}

// One pass over all planes: lists those with n . v > slack - margin, rounding allowed for, for a corner v.
//
// Corners are relative to `center`, slack = d - n . center. The error of a plane at center + v is at most
// errors[i] (|center| + |v| + 1); slack and products add less than 8 u (|center| + |v| + 1). What is not listed
// is therefore clear of every corner, and so of their hull, by more than `margin`; no neighbourhood of corners
// and no hull is trusted for that.
UnfilledVector<Index> planes_reaching(Points normals, Doubles offsets, Doubles errors, const double* center,
                                      Points corners, double margin, Span<const bool> among, int threads, Stop& stop) {
  const CornerTree tree(corners, threads, stop);
  double extent = 0.0;
  for (Index i = 0; i < corners.size(); ++i) extent = std::max(extent, dot(corners[i], corners[i]));
  const double size = std::sqrt(dot(center, center)) + 2.0 * std::sqrt(extent) + 1.0;
  const Index n = normals.size();
  const int n_parts = worth_threads(n, kLeast, threads);
  // Room for all, of which only what is used takes memory: those of a stretch stand where it begins.
  UnfilledVector<Index> rows(n);
  constexpr Index stretch = 1 << 12;
  std::vector<Index> counts((n + stretch - 1) / stretch);
  run_in_turn(static_cast<Index>(counts.size()), n_parts, stop, [&](Index begin, Index end, int, Stop& own) {
    for (Index k = begin; k < end; ++k) {
      const Index first = k * stretch, last = std::min(n, first + stretch);
      for (Index i = first; i < last; ++i) {
        own.poll();
        if (among.size() > 0 && !among[i]) continue;
        own.poll(15);
        const double slack = offsets[i] - dot(normals[i], center);
        const double pad = (errors[i] + 8.0 * kUnitRoundoff) * size;
        if (tree.reaches(normals[i], slack - pad - margin)) rows[first + counts[k]++] = i;
      }
    }
  });
  Index count = 0;
  for (Index k = 0; k < static_cast<Index>(counts.size()); ++k) {
    if (count < k * stretch) std::copy_n(rows.begin() + k * stretch, counts[k], rows.begin() + count);
    count += counts[k];
  }
  rows.resize(count);
  return rows;
}

}  // namespace voxkernel
