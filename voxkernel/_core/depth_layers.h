// Squared distances of voxels of an object from the nearest voxel outside, some layers at a time.
#pragma once

#include <cstdint>
#include <vector>

#include "label_crop.h"
#include "spans.h"
#include "stop.h"

namespace voxkernel {

// Lower envelope of parabolas, one a voxel of a line (Felzenszwalb and Huttenlocher 2012).
class Envelope {
 public:
  explicit Envelope(Index most) : values_(most), vertex_(most), from_(most + 1) {}

  // From squared distances along axes before to those along this one, too. Of a line only stretches of the object
  // matter, each with the voxel outside before and after it: those farther away are never nearer.
  void transform(double* line, Index n, Index stride, double spacing);

 private:
  void stretch(double* line, Index first, Index last, Index stride, double spacing);

  std::vector<double> values_;
  std::vector<Index> vertex_;
  std::vector<double> from_;
};

// Layers lie across the last axis. What is found for a layer is the same, bit for bit, whatever others are asked for.
class DepthLayers {
 public:
  DepthLayers(const Crop& crop, const double* spacing);

  // Squared depths, exact but for rounding, of `n` layers from one on; `n` numbers of each row of the crop, 0 outside.
  // A flat crop is measured along its last two axes.
  void fill(Index first, Index n, double* slab, Stop& stop);

 private:
  void along_rows(Index first, Index n, double* slab, Stop& stop);

  Crop crop_;
  double spacing_[3];
  Envelope envelope_;
  std::vector<double> line_;
  std::vector<std::int32_t> runs_;  // of each row, how many voxels in line are of the object before `next_`
  Index next_ = 0;
};

}  // namespace voxkernel
