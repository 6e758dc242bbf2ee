#include "object_centroid.h"

namespace voxkernel {

CentroidOrder::CentroidOrder(const Crop& crop, const double* spacing)
    : crop_(crop), spacing_{spacing[0], spacing[1], spacing[2]} {
  const Index nk = crop.shape[2];
  for (Index i = 0; i < crop.shape[0]; ++i) {
    for (Index j = 0; j < crop.shape[1]; ++j) {
      const std::uint8_t* const row = crop.bytes.data() + crop.flat(i, j, 0);
      Index n = 0;
      for (Index k = next_voxel(row, 0, nk); k < nk; k = next_voxel(row, k + 1, nk)) {
        ++n;
        sums_[2] += k;
      }
      n_voxels_ += n;
      sums_[0] += n * i;
      sums_[1] += n * j;
    }
  }
}

bool CentroidOrder::is_nearer(Index a, Index b) const {
  const double of_a = square(a), of_b = square(b);
  return of_a != of_b ? of_a < of_b : a < b;
}

// Times the square of the number of voxels. Opposite offsets from the centroid are opposite integers.
double CentroidOrder::square(Index voxel) const {
  Index ijk[3];
  crop_.position(voxel, ijk);
  double sum = 0.0;
  for (int a = 0; a < 3; ++a) {
    const double offset = static_cast<double>(n_voxels_ * ijk[a] - sums_[a]) * spacing_[a];
    sum += offset * offset;
  }
  return sum;
}

}  // namespace voxkernel
