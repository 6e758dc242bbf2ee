#include "reach.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace voxkernel {
namespace {

constexpr double kUnitRoundoff = 0x1p-53;
constexpr Index kLeafCorners = 8;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

double dot(const double* n, const double* v) { return n[0] * v[0] + n[1] * v[1] + n[2] * v[2]; }

}  // namespace

CornerTree::CornerTree(Points corners) : corners_(corners.data(), corners.data() + 3 * corners.size()) {
  nodes_.reserve(corners.size() / 2 + 1);
  build(0, corners.size());
}

// Depth first: a node is followed by its lower half, and `skip` jumps over all that is below it.
void CornerTree::build(Index first, Index last) {
  Node node{{kInfinity, kInfinity, kInfinity}, {-kInfinity, -kInfinity, -kInfinity}, first, last, 0, true};
  for (Index i = first; i < last; ++i) {
    for (int k = 0; k < 3; ++k) {
      node.low[k] = std::min(node.low[k], corners_[3 * i + k]);
      node.high[k] = std::max(node.high[k], corners_[3 * i + k]);
    }
  }
  node.is_leaf = last - first <= kLeafCorners;
  const std::size_t at = nodes_.size();
  nodes_.push_back(node);
  if (!node.is_leaf) {
    int axis = 0;
    for (int k = 1; k < 3; ++k) {
      if (node.high[k] - node.low[k] > node.high[axis] - node.low[axis]) axis = k;
    }
    auto* rows = reinterpret_cast<std::array<double, 3>*>(corners_.data());
    const Index middle = first + (last - first) / 2;
    std::nth_element(rows + first, rows + middle, rows + last,
                     [axis](const auto& a, const auto& b) { return a[axis] < b[axis]; });
    build(first, middle);
    build(middle, last);
  }
  nodes_[at].skip = static_cast<Index>(nodes_.size());
}

double CornerTree::largest(const double* normal, double floor) const {
  double best = floor;
  const Index end = static_cast<Index>(nodes_.size());
  for (Index at = 0; at < end;) {
    const Node& node = nodes_[at];
    const double* x = normal[0] > 0.0 ? node.high : node.low;
    const double* y = normal[1] > 0.0 ? node.high : node.low;
    const double* z = normal[2] > 0.0 ? node.high : node.low;
    // Rounded like the products below, and each term is not smaller: never below what a corner gives.
    if (!(normal[0] * x[0] + normal[1] * y[1] + normal[2] * z[2] > best)) {
      at = node.skip;
      continue;
    }
    if (node.is_leaf) {
      for (Index i = node.first; i < node.last; ++i) {
        best = std::max(best, dot(normal, &corners_[3 * i]));
      }
    }
    ++at;
  }
  return best;
}

// One pass over all planes: lists those with n . v > slack - margin, rounding allowed for, for a corner v.
//
// Corners are relative to `center`, slack = d - n . center. The error of a plane at center + v is at most
// errors[i] (|center| + |v| + 1); slack and products add less than 8 u (|center| + |v| + 1). What is not listed
// is therefore clear of every corner, and so of their hull, by more than `margin`; no neighbourhood of corners
// and no hull is trusted for that.
Reach planes_reaching(Points normals, Doubles offsets, Doubles errors, const double* center, Points corners,
                      double margin, Stop& stop) {
  const CornerTree tree(corners);
  double extent = 0.0;
  for (Index i = 0; i < corners.size(); ++i) extent = std::max(extent, dot(corners[i], corners[i]));
  const double size = std::sqrt(dot(center, center)) + 2.0 * std::sqrt(extent) + 1.0;
  Reach reach;
  for (Index i = 0; i < normals.size(); ++i) {
    stop.poll(16);
    const double* n = normals[i];
    const double slack = offsets[i] - dot(n, center);
    const double pad = (errors[i] + 8.0 * kUnitRoundoff) * size;
    const double floor = slack - pad - margin;
    const double best = tree.largest(n, floor);
    if (best > floor) {
      reach.rows.push_back(i);
      reach.excess.push_back(best - slack);
      reach.pads.push_back(pad);
    }
  }
  return reach;
}

}  // namespace voxkernel
