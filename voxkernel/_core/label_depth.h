// Squared distance of every voxel of an object from the nearest voxel outside, centre to centre.
#pragma once

#include "label_crop.h"
#include "spans.h"
#include "stop.h"

namespace voxkernel {

// Exact Euclidean distances in world units; 0 outside. A flat crop is measured along its last two axes.
void squared_depths(const Crop& crop, const double* spacing, Span<double> depths, Stop& stop);

}  // namespace voxkernel
