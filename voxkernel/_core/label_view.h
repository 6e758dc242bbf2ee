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
  bool sees(Index from, const Index* d, Index& n_steps) const {
    SegmentWalk walk(from, d, strides_);
    bool is_inside = true;
    while (is_inside && walk.advance()) {
      ++n_steps;
      is_inside = bytes_[walk.at()] != 0;
    }
    return is_inside;
  }

  // Counts what a voxel of the object sees; where `seen` is not empty, it is filled with 1 for those and 0 elsewhere.
  Index count(const Index* center, Span<std::uint8_t> seen, Stop& stop);

 private:
  Index count_plane(const Index* center, Index i, Span<std::uint8_t> seen, Stop& stop);

  Crop crop_;
  const std::uint8_t* bytes_;
  Index strides_[3];
  std::vector<std::uint8_t> clear_;  // the box between the centre and the voxel is in the object
};

}  // namespace voxkernel
