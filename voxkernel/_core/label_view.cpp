#include "label_view.h"

#include <algorithm>

namespace voxkernel {

LabelView::LabelView(const Crop& crop)
    : crop_(crop),
      bytes_(crop.bytes.data()),
      strides_{crop.stride(0), crop.stride(1), 1},
      steps_(crop.shape, strides_),
      clear_(static_cast<std::size_t>(crop.size()), 0) {}

// A segment stays in the box between its ends, whatever it touches. So a voxel is seen when that box is in the object,
// which is so when it is for the neighbours nearer to the centre along each axis. The others walk towards the centre
// until they come to such a voxel.
Index LabelView::count(const Index* center, Span<std::uint8_t> seen, Stop& stop) {
  if (seen.size() != 0) std::fill(seen.begin(), seen.end(), std::uint8_t{0});
  Index n = 0;
  for (Index i = center[0]; i < crop_.shape[0] - 1; ++i) n += count_plane(center, i, seen, stop);
  for (Index i = center[0] - 1; i > 0; --i) n += count_plane(center, i, seen, stop);
  return n;
}

Index LabelView::count_plane(const Index* center, Index i, Span<std::uint8_t> seen, Stop& stop) {
  const Index ni = crop_.shape[1], nk = crop_.shape[2];
  const Index back_i = i == center[0] ? 0 : i > center[0] ? -strides_[0] : strides_[0];
  Index n = 0, n_steps = 0;
  for (int half = 0; half < 4; ++half) {
    // Rows from the middle outwards, each from its middle outwards.
    const bool down = (half & 2) != 0, left = (half & 1) != 0;
    const Index first_j = down ? center[1] - 1 : center[1], last_j = down ? 0 : ni - 1, step_j = down ? -1 : 1;
    const Index first_k = left ? center[2] - 1 : center[2], last_k = left ? 0 : nk - 1, step_k = left ? -1 : 1;
    for (Index j = first_j; j != last_j; j += step_j) {
      const Index row = (i * ni + j) * nk;
      const Index back_j = j == center[1] ? 0 : -step_j * nk;
      for (Index k = first_k; k != last_k; k += step_k) {
        const Index v = row + k;
        if (bytes_[v] == 0) {
          clear_[v] = 0;
          continue;
        }
        const Index back_k = k == center[2] ? 0 : -step_k;
        // A step of 0 would look at the voxel itself, which is not known yet.
        bool is_clear = (back_i == 0 || clear_[v + back_i] != 0) && (back_j == 0 || clear_[v + back_j] != 0) &&
                        (back_k == 0 || clear_[v + back_k] != 0);
        clear_[v] = is_clear ? 1 : 0;
        if (!is_clear) {
          const Index d[3] = {center[0] - i, center[1] - j, center[2] - k};
          if (!walks(v, d, n_steps, [&](Index at) { return clear_[at] != 0; })) continue;
        }
        ++n;
        if (seen.size() != 0) seen[v] = 1;
      }
      stop.poll(nk + n_steps);
      n_steps = 0;
    }
  }
  return n;
}

}  // namespace voxkernel
