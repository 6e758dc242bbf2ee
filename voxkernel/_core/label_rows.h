// What a voxel does not see of its object, by whole rows of voxels as bits.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "label_crop.h"
#include "label_segments.h"
#include "pages.h"
#include "spans.h"
#include "stop.h"

namespace voxkernel {

// The voxels of an object are the targets. Segments have to stay in the object, widened by `reach` voxels along every
// axis: a target that is hidden there from a voxel is hidden from all within `reach` of it along every axis.
//
// Rows that are made `like` others share with these what is the same and what is of use during a look only.
class LabelRows {
 public:
  LabelRows(const Crop& crop, Index reach, const LabelRows* like = nullptr);
  LabelRows(const LabelRows&) = delete;
  LabelRows& operator=(const LabelRows&) = delete;

  // How many targets are hidden from a voxel in the widened object: one of the crop, or the middle of a cube of edge
  // 2 `reach` + 1 that is at multiples of that and begins in the crop. Some number above `enough` where there are more.
  // `n_steps` grows by about the number of rows and voxels looked at.
  Index hidden(const Index* voxel, Index enough, Index& n_steps, Stop& stop);
  // The targets that were hidden last, positions in the crop; the object was not widened, and `enough` not reached.
  void list_hidden(const Crop& crop, std::vector<Index>& targets) const;

 private:
  using Word = std::uint64_t;
  // A run of background in row (i, j), both ends included. No run: `first` > `last`.
  struct Wall {
    std::int32_t i, j, first, last;
  };
  // In two bytes a number where rows are short enough for that.
  class Walls {
   public:
    Walls() = default;
    Walls(Index n, const Index* shape);
    Wall operator[](Index at) const;
    void set(Index at, const Wall& wall);

   private:
    struct ShortWall {
      std::uint16_t i, j, first, last;  // the last two greater by one; 0 and 65,535 for ever
    };
    std::vector<ShortWall> short_;
    std::vector<Wall> long_;
  };

  void take_targets(const Crop& crop);
  void widen(Index reach);
  void stand_at(const Index* voxel);
  void look_at(Index i, Index j);
  const Word* targets_of(Index i, Index j) const;
  Word targets_in(const Word* row, Index word) const;
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
  Index extent_[3];  // of the crop along these axes
  Index margin_[3];  // layers before the crop; across the rows only as many as are looked at
  Index shape_[3];
  Index full_[2];              // shape across the rows with all that is open
  Index strides_[3];           // a row is filled up to whole words
  Index n_words_;              // of a row
  Index n_own_ = 0;            // words of a row of the crop
  Index whole_ = 0, bit_ = 0;  // its word 0, from bit `bit_` on, is in word `whole_` of a row
  struct Shared {
    Brief<Word> targets;  // rows of the crop, without margins
    Brief<Word> seen;     // as many words as are open, or more
  };
  std::shared_ptr<Shared> shared_;
  Brief<Word> widened_;  // none where nothing is widened: the targets are what is open
  const Word *targets_ = nullptr, *open_ = nullptr;
  Word* seen_ = nullptr;
  std::vector<std::uint8_t> is_open_;  // rows
  Walls walls_;                        // two a row: what hid something above and below the centre last
  SegmentSteps steps_;
  const Word* row_targets_ = nullptr;  // of the row at work, nothing outside the crop
  Index center_[3], at_ = 0, offset_[3];
  Index back_i_ = 0, back_j_ = 0;  // to the rows nearer to the centre, 0 where there is none
  Index n_steps_ = 0;
  Index n_hidden_ = 0;
};

}  // namespace voxkernel
