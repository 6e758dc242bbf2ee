// The voxel that sees most of its object, with bounds on how much the best one sees.
#pragma once

#include "label_crop.h"
#include "label_depth.h"
#include "spans.h"
#include "stop.h"

namespace voxkernel {

struct BestVoxel {
  Index voxel = 0;    // in the crop
  Index n_seen = 0;   // from there
  Index upper = 0;    // no voxel sees more than this
  Index deepest = 0;  // the voxel farthest from the outside, the first of them
  Index deepest_seen = 0;
  Index other_seen = 0;  // from a voxel that was asked for; 0 if that is outside
  Index n_steps = 0;     // voxels looked at
};

// Of voxels that see equally much the deepest counts, of these the one nearest to the centroid, then the first. The
// bounds meet for objects of up to `always` voxels, and for others that `most_steps` are enough for. What is seen from
// `other`, a position in the crop, is told, too.
BestVoxel best_voxel(const Crop& crop, const Depths& depths, Index other, Index always, Index most_steps, Stop& stop);

}  // namespace voxkernel
