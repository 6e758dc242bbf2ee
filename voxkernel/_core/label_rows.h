// What a voxel does not see of its object, by whole rows of voxels as bits.
#pragma once

#include <cstdint>
#include <vector>

#include "label_crop.h"
#include "label_segments.h"
#include "spans.h"
#include "stop.h"

namespace voxkernel {

// The voxels of an object are the targets. Segments have to stay in the object, widened by `reach` voxels along every
// axis: a target that is hidden there from a voxel is hidden from all within `reach` of it along every axis.
class LabelRows {
 public:
  LabelRows(const Crop& crop, Index reach);

  // How many targets are hidden from a voxel of the crop that is in the widened object; some number above `enough`
  // where there are more. `n_steps` grows by about the number of rows and voxels looked at.
  Index hidden(const Index* voxel, Index enough, Index& n_steps, Stop& stop);
  // The targets that were hidden last, positions in the crop; the object was not widened, and `enough` not reached.
  void list_hidden(const Crop& crop, std::vector<Index>& targets) const;

 private:
  using Word = std::uint64_t;
  // A run of background in row (i, j), both ends included. No run: `first` > `last`.
  struct Wall {
    std::int32_t i, j, first, last;
  };

  void stand_at(const Index* voxel);
  void look_at(Index i, Index j);
  template <bool is_up>
  void half_row(Index row);
  template <bool is_up>
  Word sure(Index at, Index word, Word mask, bool goes_on, Word& chain) const;
  template <bool is_up>
  Word dark(Index row, Index word, Index k);
  template <bool is_up>
  Word shadow(const Wall& wall, Index word, Index k) const;
  template <bool is_up>
  Word within(Index word, Index c) const;
  Index find_wall(Index row, Index k);
  Wall wall_at(Index position) const;

  int axes_[3];      // of the crop; the rows run along the last
  Index margin_[3];  // layers around the crop
  Index shape_[3];
  Index strides_[3];  // a row is filled up to whole words
  Index n_words_;     // of a row
  std::vector<Word> targets_, open_, seen_;
  std::vector<std::uint8_t> is_open_;  // rows
  std::vector<Wall> walls_;            // two a row: what hid something above and below the centre last
  SegmentSteps steps_;
  Index center_[3], at_ = 0, offset_[3];
  Index back_i_ = 0, back_j_ = 0;  // to the rows nearer to the centre, 0 where there is none
  Index n_steps_ = 0;
  Index n_hidden_ = 0;
};

}  // namespace voxkernel
