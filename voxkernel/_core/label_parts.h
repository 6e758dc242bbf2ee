// Fragments of an object and cavities in it.
#pragma once

#include <cstdint>

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

// The object with its holes, a byte for each voxel of the crop.
void fill_holes(const Crop& crop, Span<std::uint8_t> filled, Stop& stop);

}  // namespace voxkernel
