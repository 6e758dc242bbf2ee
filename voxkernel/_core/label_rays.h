// Rays from a voxel to the end of its object, and how well the star-shaped body they span agrees with it.
#pragma once

#include <cstdint>
#include <vector>

#include "label_crop.h"
#include "spans.h"
#include "stop.h"

namespace voxkernel {

// Lengths along `directions` (in voxels along the axes, of any length, in whose multiples the answer is) from the
// centre of a voxel of the object. Exact: where the ray leaves the last voxel, a ray through an edge or a corner going
// on diagonally. Stepped, as StarDist does: from one sample to the next, one voxel apart, until the nearest voxel is
// outside. Then the length is that from centre to centre of these two voxels; in a flat crop that of the samples, less
// one voxel and half a voxel along the axis the ray advances most.
enum class RayEnd { kExact, kStepped };
void ray_lengths(const Crop& crop, const Index* center, Points directions, RayEnd end, Span<double> lengths,
                 Stop& stop);

struct StarCount {
  Index size = 0;    // voxel centres in the star-shaped body and in the image
  Index common = 0;  // of these, in the object
};

// Counts row by row: between two passages of its surface a row is inside.
class StarRaster {
 public:
  explicit StarRaster(const Crop& crop);

  // `ends` are the ends of the rays, in voxels from the centre; `faces` triangles between them that turn like
  // (e0, e1, e2); for a flat crop the ends are in order of their angle and there are no faces. `low` and `high` are the
  // first and the last voxel of the image, in the coordinates of the crop, which may be outside.
  StarCount count(const Index* center, Points ends, Triangles faces, const Index* low, const Index* high, Stop& stop);

 private:
  void pass(Index i, Index j, double x, bool leaves);

  // 64 voxels of a row, and how many before them are of the object.
  struct Stretch {
    std::uint64_t bits;
    Index before;
  };

  Index count_to(Index i, Index j, Index k) const;

  Crop crop_;
  std::vector<std::uint16_t> before_;  // voxels of the object in a row up to and with each, for a small crop
  Index n_stretches_ = 0;              // of a row
  std::vector<Stretch> stretches_;
  Index center_[3] = {0, 0, 0}, low_[3] = {0, 0, 0}, high_[3] = {0, 0, 0};
  StarCount count_;
};

}  // namespace voxkernel
