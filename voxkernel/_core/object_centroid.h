// How near the voxels of an object are to its centroid.
#pragma once

#include "label_crop.h"
#include "spans.h"

namespace voxkernel {

// Tells apart voxels that are equally good otherwise, the same way in a mirror: in a rod the middle of the axis is as
// deep as its ends.
class CentroidOrder {
 public:
  // The crop has to live on.
  CentroidOrder(const Crop& crop, const double* spacing);

  // Whether a voxel is nearer to the centroid than another one in the world, the first of two that are equally near.
  bool is_nearer(Index a, Index b) const;

 private:
  double square(Index voxel) const;

  Crop crop_;
  double spacing_[3];
  Index n_voxels_ = 0, sums_[3] = {0, 0, 0};  // of positions
};

}  // namespace voxkernel
