#include "voxel_looks.h"

namespace voxkernel {

VoxelLooks::VoxelLooks(const Crop& crop, const Depths& depths, Stop& stop)
    : crop_(crop), depths_(depths), stop_(stop), rows_(crop, 0) {
  for (Index v = 0; v < crop.size(); ++v) {
    if (crop.bytes[v] == 0) continue;
    ++n_voxels_;
    if (depths.cubes() == nullptr && (deepest_ < 0 || is_deeper(v, deepest_))) deepest_ = v;
  }
  if (depths.cubes() != nullptr) {
    const Index low[3] = {0, 0, 0};
    deepest_ = depths.cubes()->find(low, crop.shape).voxel;
  }
  is_known_.assign(static_cast<std::size_t>(crop.size()), false);
  winner_ = deepest_;
  least_ = hidden_from_deepest_ = look_at(deepest_, n_voxels_);
}

Index VoxelLooks::look_at(Index voxel, Index enough) {
  is_known_[voxel] = true;
  Index ijk[3];
  crop_.position(voxel, ijk);
  const Index before = n_steps_;
  const Index hidden = rows_.hidden(ijk, enough, n_steps_, stop_);
  look_steps_ += n_steps_ - before;
  ++n_looks_;
  return hidden;
}

bool VoxelLooks::take(Index voxel, Index hidden) {
  if (hidden > enough(voxel)) return false;
  least_ = hidden;
  winner_ = voxel;
  return true;
}

void VoxelLooks::start_over() {
  if (winner_ != deepest_) is_known_[winner_] = false;
  winner_ = deepest_;
  least_ = hidden_from_deepest_;
}

const std::vector<Index>& VoxelLooks::list_hidden(Index voxel) {
  take(voxel, look_at(voxel, n_voxels_));
  rows_.list_hidden(crop_, hidden_);
  return hidden_;
}

}  // namespace voxkernel
