#include "label_segments.h"

#include <algorithm>

namespace voxkernel {
namespace {

constexpr double kMostSteps = 0x1p25;  // bytes of steps that are kept
constexpr Index kSmall = 64;           // longest edge of a small box: at most 5 MB of steps

KeptSteps& of_small_boxes() {
  constexpr Index edges[3] = {kSmall, kSmall, kSmall};
  static thread_local KeptSteps kept(edges);
  return kept;
}

}  // namespace

KeptSteps::KeptSteps(const Index* edges) {
  std::int32_t n = 0;
  for (Index k = 0; k < edges[1]; ++k) {
    places_[1].push_back(n);
    n += static_cast<std::int32_t>(std::min(k + 1, edges[2]));
  }
  places_[1].push_back(n);
  n = 0;
  for (Index k = 0; k < edges[0]; ++k) {
    places_[0].push_back(n);
    n += places_[1][std::min(k + 1, edges[1])];
  }
  first_.assign(static_cast<std::size_t>(n), -1);
}

std::int32_t KeptSteps::append(const Index* n) {
  const std::int32_t first = static_cast<std::int32_t>(steps_.size());
  const Index nothing[3] = {0, 0, 0};
  SegmentWalk walk(0, n, nothing);
  for (unsigned axes = walk.step(); axes != 0; axes = walk.step()) steps_.push_back(static_cast<std::uint8_t>(axes));
  steps_.insert(steps_.end(), kEnds, 0);
  return first;
}

SegmentSteps::SegmentSteps(const Index* shape, const Index* strides) {
  double n_segments = 1.0, longest = 1.0;
  Index edges[3] = {shape[0], shape[1], shape[2]};
  std::sort(edges, edges + 3, [](Index a, Index b) { return a > b; });
  for (int a = 0; a < 3; ++a) {
    n_segments *= static_cast<double>(shape[a]);
    longest += static_cast<double>(shape[a]);
  }
  for (unsigned order = 0; order < 8; ++order) {
    for (unsigned signs = 0; signs < 8; ++signs) {
      for (unsigned step = 0; step < 8; ++step) {
        Index move = 0;
        for (unsigned k = 0; k < 3; ++k) {
          const unsigned axis = kOrders[order][k];
          if ((step >> k & 1u) != 0) move += (signs >> axis & 1u) != 0 ? -strides[axis] : strides[axis];
        }
        moves_[order][signs][step] = move;
      }
    }
  }
  if (edges[0] <= kSmall) {
    kept_ = &of_small_boxes();
    return;
  }
  // Half of the longest is the mean.
  if (0.5 * n_segments * longest > kMostSteps) return;
  own_ = std::make_unique<KeptSteps>(edges);
  kept_ = own_.get();
}

// The walk runs in an array that just holds both ends.
std::vector<Index> touched_voxels(const Index* from, const Index* to) {
  Index low[3], shape[3], d[3], strides[3];
  for (int a = 0; a < 3; ++a) {
    low[a] = std::min(from[a], to[a]);
    d[a] = to[a] - from[a];
    shape[a] = std::max(from[a], to[a]) - low[a] + 1;
  }
  strides[0] = shape[1] * shape[2];
  strides[1] = shape[2];
  strides[2] = 1;
  const Index start = (from[0] - low[0]) * strides[0] + (from[1] - low[1]) * strides[1] + (from[2] - low[2]);
  std::vector<Index> found{from[0], from[1], from[2]};
  SegmentWalk walk(start, d, strides);
  while (walk.advance()) {
    const Index v = walk.at();
    found.push_back(low[0] + v / strides[0]);
    found.push_back(low[1] + v / shape[2] % shape[1]);
    found.push_back(low[2] + v % shape[2]);
  }
  return found;
}

}  // namespace voxkernel
