// The best voxel of an object that is not large, by bounds for whole tiles of candidates.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "label_tiles.h"
#include "race_tiles.h"
#include "voxel_looks.h"

namespace voxkernel {

class TileRace {
 public:
  explicit TileRace(VoxelLooks& looks);

  // Whether a pass over all tiles takes few of the steps there are.
  bool is_short();
  // The least that may be hidden from a voxel that was not looked at because steps were over; INT64_MAX for none.
  Index run();

 private:
  // A tile, the least that may be hidden from one of its candidates, and the deepest of these.
  struct Tile {
    RaceTile of;
    Index hidden, voxel;
  };

  // Whether a candidate may still see most, and whether one is more promising than another one.
  bool is_open(const Candidate& c) const {
    return !looks_.is_known(c.voxel) && bounds_[c.voxel] <= looks_.enough(c.voxel);
  }
  bool is_before(const Candidate& a, const Candidate& b) const {
    const std::int32_t of_a = bounds_[a.voxel], of_b = bounds_[b.voxel];
    return of_a != of_b ? of_a < of_b : looks_.is_deeper(a.voxel, b.voxel);
  }
  int best_order();
  bool cut();
  void drop(std::vector<Candidate>& candidates) const;
  std::vector<Tile> tiles_by_bound();
  void work(int pass, const RaceTile& tile, Index most);
  void go_ahead(int pass);
  Index promising() const;
  Index least_open() const;

  VoxelLooks& looks_;
  std::vector<Candidate> candidates_, sorted_, ahead_;
  std::vector<std::int32_t> bounds_;  // of each voxel of the crop, how many are hidden from it at least
  std::vector<Index> hidden_;         // of a tile
  std::unique_ptr<LabelTiles> tiles_;
  bool is_cut_ = false;
};

}  // namespace voxkernel
