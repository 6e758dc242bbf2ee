#include "sight_tree.h"

#include <limits>

namespace voxkernel {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

Box nothing() { return {{kInfinity, kInfinity, kInfinity}, {-kInfinity, -kInfinity, -kInfinity}}; }

void include(Box& box, const Box& other) {
  for (int k = 0; k < 3; ++k) {
    box.low[k] = std::min(box.low[k], other.low[k]);
    box.high[k] = std::max(box.high[k], other.high[k]);
  }
}

double half_area(const Box& box) {
  const double x = box.high[0] - box.low[0], y = box.high[1] - box.low[1], z = box.high[2] - box.low[2];
  return x >= 0.0 ? x * y + y * z + z * x : 0.0;
}

struct Task {
  std::int32_t node, first, last;
  int depth;
};

struct Split {
  int axis = -1;
  double at = 0.0;
  double cost = kInfinity;
};

double middle_of(const Box& box, int k) { return 0.5 * box.low[k] + 0.5 * box.high[k]; }

// The cut of 16 bins an axis with the least sum of area times number.
Split best_split(const std::vector<Box>& boxes, const std::int32_t* ids, std::int32_t n, const Box& middles) {
  constexpr int kBins = 16;
  Split best;
  for (int k = 0; k < 3; ++k) {
    const double low = middles.low[k], size = middles.high[k] - low;
    if (!(size > 0.0)) continue;
    Box bins[kBins];
    int counts[kBins] = {};
    for (auto& bin : bins) bin = nothing();
    for (std::int32_t i = 0; i < n; ++i) {
      const Box& box = boxes[ids[i]];
      const int bin = std::min(kBins - 1, static_cast<int>((middle_of(box, k) - low) / size * kBins));
      include(bins[bin], box);
      ++counts[bin];
    }
    double right[kBins];
    Box sum = nothing();
    int number = 0;
    for (int b = kBins - 1; b > 0; --b) {
      include(sum, bins[b]);
      number += counts[b];
      right[b] = half_area(sum) * number;
    }
    sum = nothing();
    number = 0;
    for (int b = 0; b + 1 < kBins; ++b) {
      include(sum, bins[b]);
      number += counts[b];
      const double cost = half_area(sum) * number + right[b + 1];
      if (number > 0 && number < n && cost < best.cost) best = {k, low + size * (b + 1) / kBins, cost};
    }
  }
  return best;
}

}  // namespace

SightTree::SightTree(Points vertices, Triangles faces, Stop& stop) : corners_(9 * faces.size()) {
  std::vector<Box> boxes(faces.size());
  order_.resize(faces.size());
  for (Index f = 0; f < faces.size(); ++f) {
    stop.poll(2);
    Box box = nothing();
    for (int c = 0; c < 3; ++c) {
      for (int k = 0; k < 3; ++k) {
        const double x = vertices(faces(f, c), k);
        corners_[9 * f + 3 * c + k] = x;
        box.low[k] = std::min(box.low[k], x);
        box.high[k] = std::max(box.high[k], x);
      }
    }
    boxes[f] = box;
    order_[f] = static_cast<std::int32_t>(f);
  }
  build(boxes, stop);
}

void SightTree::build(const std::vector<Box>& boxes, Stop& stop) {
  const auto n = static_cast<std::int32_t>(boxes.size());
  nodes_.reserve(boxes.size());
  nodes_.push_back({});
  std::vector<Task> tasks{{0, 0, n, 0}};
  while (!tasks.empty()) {
    const Task task = tasks.back();
    tasks.pop_back();
    const std::int32_t count = task.last - task.first;
    stop.poll(8 * count + 1);
    Box box = nothing(), middles = nothing();
    for (std::int32_t i = task.first; i < task.last; ++i) {
      const Box& one = boxes[order_[i]];
      include(box, one);
      Box middle;
      for (int k = 0; k < 3; ++k) middle.low[k] = middle.high[k] = middle_of(one, k);
      include(middles, middle);
    }
    nodes_[task.node].box = box;
    if (count <= kLeaf) {
      nodes_[task.node].first = task.first;
      nodes_[task.node].count = count;
      continue;
    }
    std::int32_t* ids = order_.data() + task.first;
    std::int32_t cut = count / 2;
    // Below this depth halves are forced, so that walks need a stack of a known size.
    const Split split = task.depth < 40 ? best_split(boxes, ids, count, middles) : Split{};
    if (split.axis >= 0) {
      const auto end = std::partition(ids, ids + count,
                                      [&](std::int32_t id) { return middle_of(boxes[id], split.axis) < split.at; });
      const auto size = static_cast<std::int32_t>(end - ids);
      if (size > 0 && size < count) cut = size;
    }
    const auto left = static_cast<std::int32_t>(nodes_.size());
    nodes_[task.node].first = left;
    nodes_[task.node].count = 0;
    nodes_.push_back({});
    nodes_.push_back({});
    tasks.push_back({left + 1, task.first + cut, task.last, task.depth + 1});
    tasks.push_back({left, task.first, task.first + cut, task.depth + 1});
  }
}

}  // namespace voxkernel
