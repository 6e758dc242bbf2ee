// Voxels looked at one by one, and the best of them so far.
#pragma once

#include <vector>

#include "label_crop.h"
#include "label_depth.h"
#include "label_rows.h"
#include "spans.h"
#include "stop.h"

namespace voxkernel {

class VoxelLooks {
 public:
  // The deepest voxel is looked at, and is the best so far.
  VoxelLooks(const Crop& crop, const Depths& depths, Stop& stop);

  const Crop& crop() const { return crop_; }
  Stop& stop() const { return stop_; }
  const LabelRows& rows() const { return rows_; }
  Index n_voxels() const { return n_voxels_; }
  Index deepest() const { return deepest_; }
  Index hidden_from_deepest() const { return hidden_from_deepest_; }
  Index n_steps() const { return n_steps_; }

  Index winner() const { return winner_; }
  Index least() const { return least_; }  // hidden from it
  bool is_deeper(Index a, Index b) const { return depths_.is_deeper(a, b); }
  // What may be hidden at most from a voxel that is better than the best so far: of voxels from which equally much is
  // hidden the deepest counts, then the one nearest to the centroid.
  Index enough(Index voxel) const { return least_ - (is_deeper(voxel, winner_) ? 0 : 1); }
  bool is_known(Index voxel) const { return is_known_[voxel]; }
  void set_known(Index voxel, bool is) { is_known_[voxel] = is; }

  // How many voxels are hidden from one; some number above `enough` where there are more.
  Index look_at(Index voxel, Index enough);
  // The best so far is this one if no more than that is hidden from it.
  bool take(Index voxel, Index hidden);
  // Looks at a voxel that was not looked at, only as far as needed to take it or not.
  bool consider(Index voxel) { return !is_known(voxel) && take(voxel, look_at(voxel, enough(voxel))); }
  // From the deepest voxel again, as if no other one had been the best.
  void start_over();
  // The voxels hidden from one, which is taken if it is the best so far.
  const std::vector<Index>& list_hidden(Index voxel);

  // A limit of steps, INT64_MAX for none. Some do not count.
  void set_limit(Index most_steps) { limit_ = most_steps; }
  Index limit() const { return limit_; }
  bool is_over() const { return n_steps_ - free_steps_ >= limit_; }
  Index& steps() { return n_steps_; }
  void free_steps_since(Index before) { free_steps_ += n_steps_ - before; }
  // Whether so many voxels take at most so many steps one by one, as far as is known.
  bool are_few(Index n, Index steps) const { return n * look_steps_ <= steps * n_looks_; }

 private:
  const Crop& crop_;
  const Depths& depths_;
  Stop& stop_;
  LabelRows rows_;
  std::vector<bool> is_known_;  // of each voxel of the crop, whether it was looked at
  std::vector<Index> hidden_;
  Index n_voxels_ = 0, deepest_ = -1, hidden_from_deepest_ = 0;
  Index least_ = 0, winner_ = -1;
  Index n_steps_ = 0, limit_ = INT64_MAX, free_steps_ = 0;
  Index look_steps_ = 0, n_looks_ = 0;
};

}  // namespace voxkernel
