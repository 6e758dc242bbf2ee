// Fragments of an object and cavities in it.
#pragma once

#include "label_crop.h"
#include "spans.h"
#include "stop.h"

namespace voxkernel {

struct LabelParts {
  Index n_fragments = 0;       // joined through faces, edges and corners, as segments pass
  Index largest_fragment = 0;  // voxels
  Index n_holes = 0;           // of background, joined through faces, that no path of background leads out of
  Index hole_voxels = 0;
};
LabelParts label_parts(const Crop& crop, Stop& stop);

}  // namespace voxkernel
