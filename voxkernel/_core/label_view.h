// What a voxel of an object sees: the voxels whose segment to it stays in the object.
#pragma once

#include <vector>

#include "label_crop.h"
#include "label_segments.h"
#include "spans.h"
#include "stop.h"

namespace voxkernel {

// A view of one object after the other; its memory is used again.
class LabelView {
 public:
  explicit LabelView(const Crop& crop);

  // Whether the segment between two voxels of the object stays in it; `n_steps` grows by the voxels looked at.
  bool sees(Index from, const Index* d, Index& n_steps) {
    return walks(from, d, n_steps, [](Index) { return false; });
  }

  // Counts what a voxel of the object sees; where `seen` is not empty, it is filled with 1 for those and 0 elsewhere.
  Index count(const Index* center, Span<std::uint8_t> seen, Stop& stop);

 private:
  // Whether all voxels of a segment are in the object, up to one that `is_goal`.
  template <typename IsGoal>
  bool walks(Index from, const Index* d, Index& n_steps, IsGoal&& is_goal) {
    if (!steps_.is_kept()) {
      SegmentWalk walk(from, d, strides_);
      while (walk.advance()) {
        ++n_steps;
        if (is_goal(walk.at())) return true;
        if (bytes_[walk.at()] == 0) return false;
      }
      return true;
    }
    const SegmentSteps::Found found = steps_.find(d);
    const std::uint8_t* step = found.steps;
    const Index* moves = found.moves;
    const std::uint8_t* const first = step;
    bool is_seen = true;
    for (; *step != 0; ++step) {
      from += moves[*step];
      if (is_goal(from)) break;
      if (bytes_[from] == 0) {
        is_seen = false;
        break;
      }
    }
    n_steps += step - first + 1;
    return is_seen;
  }
  Index count_plane(const Index* center, Index i, Span<std::uint8_t> seen, Stop& stop);

  Crop crop_;
  const std::uint8_t* bytes_;
  Index strides_[3];
  SegmentSteps steps_;
  std::vector<std::uint8_t> clear_;  // the box between the centre and the voxel is in the object
};

}  // namespace voxkernel
