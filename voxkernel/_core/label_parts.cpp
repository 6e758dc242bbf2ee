#include "label_parts.h"

#include <algorithm>
#include <vector>

namespace voxkernel {
namespace {

// Empties connected pieces of a field one after the other.
class Flood {
 public:
  Flood(const Crop& crop, std::vector<std::uint8_t>& field, bool with_corners) : field_(field) {
    for (Index i = crop.is_flat ? 0 : -1; i <= (crop.is_flat ? 0 : 1); ++i) {
      for (Index j = -1; j <= 1; ++j) {
        for (Index k = -1; k <= 1; ++k) {
          const Index n = i * i + j * j + k * k;
          if (n == 1 || (n > 1 && with_corners)) neighbours_.push_back(crop.flat(i, j, k));
        }
      }
    }
  }

  // Number of voxels of the piece that holds `seed`. It is emptied outwards in layers, which are small beside it.
  Index drain(Index seed, Stop& stop) {
    if (field_[seed] == 0) return 0;
    field_[seed] = 0;
    front_.assign(1, seed);
    Index n = 0;
    while (!front_.empty()) {
      next_.clear();
      for (const Index v : front_) {
        stop.poll(8);
        for (const Index step : neighbours_) {
          if (field_[v + step] == 0) continue;
          field_[v + step] = 0;
          next_.push_back(v + step);
        }
      }
      n += static_cast<Index>(front_.size());
      front_.swap(next_);
    }
    return n;
  }

 private:
  std::vector<std::uint8_t>& field_;
  std::vector<Index> neighbours_, front_, next_;
};

// `visit(voxel, is_at_the_rim)` for every voxel within the layer of background.
template <typename Visit>
void each_inner(const Crop& crop, Visit&& visit) {
  for (Index i = 1; i < crop.shape[0] - 1; ++i) {
    const bool end_i = !crop.is_flat && (i == 1 || i == crop.shape[0] - 2);
    for (Index j = 1; j < crop.shape[1] - 1; ++j) {
      const bool end_j = end_i || j == 1 || j == crop.shape[1] - 2;
      const Index row = crop.flat(i, j, 0);
      for (Index k = 1; k < crop.shape[2] - 1; ++k) visit(row + k, end_j || k == 1 || k == crop.shape[2] - 2);
    }
  }
}

}  // namespace

LabelParts label_parts(const Crop& crop, Stop& stop) {
  LabelParts parts;
  std::vector<std::uint8_t> field(crop.bytes.begin(), crop.bytes.end());
  Flood pieces(crop, field, true);
  each_inner(crop, [&](Index v, bool) {
    const Index n = pieces.drain(v, stop);
    if (n == 0) return;
    ++parts.n_fragments;
    parts.largest_fragment = std::max(parts.largest_fragment, n);
  });
  // The layer around counts as visited: what is open to it is emptied first, the rest are holes.
  each_inner(crop, [&](Index v, bool) { field[v] = crop.bytes[v] == 0 ? 1 : 0; });
  Flood outside(crop, field, false);
  each_inner(crop, [&](Index v, bool is_at_the_rim) {
    if (is_at_the_rim) outside.drain(v, stop);
  });
  each_inner(crop, [&](Index v, bool) {
    const Index n = outside.drain(v, stop);
    if (n == 0) return;
    ++parts.n_holes;
    parts.hole_voxels += n;
  });
  return parts;
}

}  // namespace voxkernel
