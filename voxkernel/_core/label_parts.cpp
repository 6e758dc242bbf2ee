#include "label_parts.h"

#include <algorithm>
#include <cstdint>
#include <limits>
#include <vector>

#include "union_find.h"

namespace voxkernel {
namespace {

// A stretch of a row, of the object or of background, both ends included.
struct Run {
  std::int32_t first, last;
};

// The runs of all rows, one row behind the other.
class Runs {
 public:
  Runs(const Crop& crop, bool is_object, Stop& stop) : crop_(crop), starts_(1, 0) {
    const Index nk = crop.shape[2], n_rows = crop.shape[0] * crop.shape[1];
    for (Index row = 0; row < n_rows; ++row) {
      const std::uint8_t* bytes = crop.bytes.data() + row * nk;
      const bool is_left_out = crop.is_flat && row / crop.shape[1] != 1;
      for (Index k = is_left_out ? nk : 0; k < nk;) {
        if ((bytes[k] != 0) != is_object) {
          ++k;
          continue;
        }
        const Index first = k;
        while (k < nk && (bytes[k] != 0) == is_object) ++k;
        runs_.push_back({static_cast<std::int32_t>(first), static_cast<std::int32_t>(k - 1)});
      }
      starts_.push_back(static_cast<Index>(runs_.size()));
      stop.poll(nk);
    }
  }

  // Number of voxels of every part, in the order of their first runs; joined through edges and corners, too, or through
  // faces only.
  std::vector<Index> sizes(bool with_corners, Stop& stop) const {
    std::vector<Index> found;
    const std::vector<Index> labels = parts(with_corners, stop);
    for (std::size_t r = 0; r < runs_.size(); ++r) {
      found.resize(std::max(found.size(), static_cast<std::size_t>(labels[r] + 1)), 0);
      found[labels[r]] += runs_[r].last - runs_[r].first + 1;
    }
    return found;
  }

  // Calls `visit(first voxel, number of voxels)` for the runs of every part but the first, joined through faces.
  template <typename Visit>
  void each_run_behind_the_first_part(Visit&& visit, Stop& stop) const {
    const std::vector<Index> labels = parts(false, stop);
    const Index nk = crop_.shape[2];
    for (Index row = 0; row + 1 < static_cast<Index>(starts_.size()); ++row) {
      for (Index r = starts_[row]; r < starts_[row + 1]; ++r) {
        if (labels[r] > 0) visit(row * nk + runs_[r].first, runs_[r].last - runs_[r].first + 1);
      }
    }
  }

 private:
  // The part of every run.
  std::vector<Index> parts(bool with_corners, Stop& stop) const {
    const bool is_small = runs_.size() <= static_cast<std::size_t>(std::numeric_limits<std::int32_t>::max());
    return is_small ? parts_as<std::int32_t>(with_corners, stop) : parts_as<Index>(with_corners, stop);
  }

  template <typename Small>
  std::vector<Index> parts_as(bool with_corners, Stop& stop) const {
    UnionFind<Small> parts(static_cast<Index>(runs_.size()));
    const Index ni = crop_.shape[0], nj = crop_.shape[1];
    const Index reach = with_corners ? 1 : 0;
    for (Index i = 0; i < ni; ++i) {
      for (Index j = 0; j < nj; ++j) {
        const Index row = i * nj + j;
        if (j > 0) join(row, row - 1, reach, parts);
        if (i > 0) {
          join(row, row - nj, reach, parts);
          if (with_corners && j > 0) join(row, row - nj - 1, reach, parts);
          if (with_corners && j < nj - 1) join(row, row - nj + 1, reach, parts);
        }
      }
      stop.poll(8 * (starts_[(i + 1) * nj] - starts_[i * nj] + nj));
    }
    return parts.labels([](Index) { return true; });
  }

  // Joins runs of two rows that have a voxel in common along the row, or neighbours where `reach` is 1.
  template <typename Small>
  void join(Index row, Index other, Index reach, UnionFind<Small>& parts) const {
    Index b = starts_[other];
    const Index end = starts_[other + 1];
    for (Index a = starts_[row]; a < starts_[row + 1]; ++a) {
      while (b < end && runs_[b].last + reach < runs_[a].first) ++b;
      for (Index c = b; c < end && runs_[c].first <= runs_[a].last + reach; ++c) parts.join(a, c);
    }
  }

  const Crop& crop_;
  std::vector<Run> runs_;
  std::vector<Index> starts_;  // of every row
};

}  // namespace

LabelParts label_parts(const Crop& crop, Stop& stop) {
  LabelParts parts;
  const std::vector<Index> fragments = Runs(crop, true, stop).sizes(true, stop);
  parts.n_fragments = static_cast<Index>(fragments.size());
  for (const Index n : fragments) parts.largest_fragment = std::max(parts.largest_fragment, n);
  // The first run of background is in the layer around, which holds together; the other parts are holes.
  const std::vector<Index> background = Runs(crop, false, stop).sizes(false, stop);
  parts.n_holes = static_cast<Index>(background.size()) - 1;
  for (std::size_t p = 1; p < background.size(); ++p) parts.hole_voxels += background[p];
  return parts;
}

void fill_holes(const Crop& crop, Span<std::uint8_t> filled, Stop& stop) {
  std::copy_n(crop.bytes.data(), crop.size(), filled.data());
  const auto fill = [&](Index first, Index n) { std::fill_n(filled.data() + first, n, std::uint8_t{1}); };
  Runs(crop, false, stop).each_run_behind_the_first_part(fill, stop);
}

}  // namespace voxkernel
