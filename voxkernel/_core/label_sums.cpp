#include "label_sums.h"

#include <algorithm>

namespace voxkernel {

void line_counts(const Crop& crop, const LineCounts& counts, Stop& stop) {
  const Index nj = crop.shape[1], nk = crop.shape[2];
  for (const Span<Index>& plane : {counts.ij, counts.ik, counts.jk}) std::fill(plane.begin(), plane.end(), Index{0});
  for (Index i = 0; i < crop.shape[0]; ++i) {
    Index* const in_ik = counts.ik.data() + i * nk;
    for (Index j = 0; j < nj; ++j) {
      const std::uint8_t* const bytes = crop.bytes.data() + crop.flat(i, j, 0);
      Index* const in_jk = counts.jk.data() + j * nk;
      Index n = 0;
      for (Index k = 0; k < nk; ++k) n += bytes[k] != 0 ? 1 : 0;
      counts.ij[i * nj + j] = n;
      if (n == 0) continue;
      for (Index k = 0; k < nk; ++k) {
        const Index one = bytes[k] != 0 ? 1 : 0;
        in_ik[k] += one;
        in_jk[k] += one;
      }
    }
    stop.poll(nj * nk);
  }
}

}  // namespace voxkernel
