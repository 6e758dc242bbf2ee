// What the voxels of a tile do not see of their object, all of them at once: a bit for each.
#pragma once

#include <cstdint>
#include <vector>

#include "avx2.h"
#include "label_crop.h"
#include "label_segments.h"
#include "spans.h"
#include "stop.h"
#include "tile_counts.h"

namespace voxkernel {

// A tile has 4 x 8 x 8 voxels of the crop, or 4 x 64 of a flat one. The segments by one d from all its voxels touch
// what the tile covers when it is moved along one of them: of all these places the bits of "in the object" have to
// be 1.
class LabelTiles {
 public:
  static constexpr Index kVoxels = TileCounts::kVoxels;

  // Whether the crop is small enough for forty bytes a voxel.
  static bool is_small(const Crop& crop) { return crop.size() <= kLargest; }
  // Probes in one of the two orders (tile_probes.h).
  LabelTiles(const Crop& crop, int order);

  static constexpr int kBounds = 5;  // passes of `bound`

  // Edges of a tile along the axes of the crop.
  const Index* edges() const { return edges_; }
  // What bounding one tile takes in steps.
  Index n_places() const { return n_places_; }
  // How many voxels of the object are hidden at least from voxel (i, j, k) of the tile with a given lowest voxel, at
  // `hidden[(i * edge + j) * edge + k]`: adds to what the passes before found, where that is at most `enough`; 0 before
  // the first. A voxel goes through all passes in turn, in whatever tile it is: each of the first three looks at a part
  // of the rows, and what is in a part depends on the distance from the voxel only; the others have more probes of all.
  // `n_steps` grows by about the places looked at.
  void bound(int pass, const Index* low, Index enough, Span<Index> hidden, Index& n_steps, Stop& stop);
  // How many are, for the voxels where what the last bound found is at most `enough` and that number is, too; a larger
  // number for others.
  void look(const Index* low, Index enough, Span<Index> hidden, Index& n_steps, Stop& stop);

 private:
  static constexpr Index kLargest = Index{1} << 20;

  // Places of a tile in a row, from the nearest to the one at work outwards.
  struct Row {
    Index at, n, step;     // the first, how many, from one to the next
    Index d[3];            // from the tile at work to the first
    Index back_j, back_k;  // to the row nearer along the other axes; 0 where there is none
  };

  // What is seen in the rows nearer along the second axis, the third and both, at the first place of a row.
  struct Near {
    const Word *j, *k, *jk;
    Index step_j, step_k, step_jk;
    Index longest;  // of the two components
    bool is_j;      // whether that is the second
  };

  Near near_of(const Row& row) const;
  void stand_at(const Index* low);
  void start_at(const Index* low, Index enough, Span<const Index> hidden);
  bool drop(Index enough);
  template <int order>
  void probe_all(int pass, Index enough, Index& n_steps, Stop& stop);
  template <int order, int stage>
  void probe_rows(int part, Index enough, Index& n_steps, Stop& stop);
  template <int stage>
  void probe(Index j, Index k);
#ifdef VOXKERNEL_HAS_AVX2
  // The lowest levels of the counts, which change with every place.
  struct Sums {
    __m256i ones, twos;
  };
  template <int order, int stage, bool is_up, int start>
  void probe_four(const Word* to, const Index* probed, __m256i own, bool has_first, Sums& sums);
  template <int order, int stage, bool is_up, int start>
  void probe_period(const Word* to, const Index* probed, __m256i own, Index nearest, Index farthest, Sums& sums);
  template <int order, int stage, bool is_up>
  void probe_way(const Word* to, Index* probed, Index nearest, Index farthest, __m256i own, Sums& sums);
  template <int order, int stage>
  void probe_avx2(Index j, Index k);
  template <int stage>
  void probe_by_tables(Index j, Index k);
#endif
  void look_at_rows(Index j, Index k);
  void look_at(const Row& row);
  void look_at_avx2(const Row& row);
  template <typename See, typename GoesOn>
  void walk(Index at, const Index* d, See&& see, GoesOn&& goes_on);

  int axes_[3];  // of the crop, those of a tile's edges of 4, 8 and 8, or of 4, 1 and 64
  Index margin_[3], shape_[3], strides_[3], edges_[3];
  std::vector<Word> words_;  // of each place, what a layer of the tile covers of the object; layers are neighbours
  std::vector<Word> seen_;   // of each place, which voxels of the tile at work see what is there; four words
  std::vector<Word> ones_;
  std::vector<std::int32_t> first_, last_;  // places of a row where a tile covers some of the object
  std::vector<Index> planes_;               // first and last such row of each plane
  std::vector<std::int32_t> probes_[3];     // by how much the places of probes differ for each d along an axis
  SegmentSteps steps_;
  TileCounts counts_;
  Index low_[3] = {0, 0, 0}, at_ = 0;  // of the tile at work
  Word own_[4] = {0, 0, 0, 0};         // which of its voxels are looked from
  Index n_steps_ = 0, n_places_ = 0;
  int order_;
  bool is_flat_ = false;
};

}  // namespace voxkernel
