#include "label_blocks.h"

#include <algorithm>
#include <utility>

#include "label_view.h"

namespace voxkernel {
namespace {

constexpr Index kMargin = 2;  // layers of background: one to widen into, one around

// 1 where a block of the object or one next to it is.
std::vector<std::uint8_t> widened(const std::vector<Index>& weights, const Index* shape) {
  std::vector<std::uint8_t> wide(weights.size(), 0);
  for (Index i = 1; i < shape[0] - 1; ++i) {
    for (Index j = 1; j < shape[1] - 1; ++j) {
      for (Index k = 1; k < shape[2] - 1; ++k) {
        if (weights[(i * shape[1] + j) * shape[2] + k] == 0) continue;
        for (Index a = i - 1; a <= i + 1; ++a) {
          for (Index b = j - 1; b <= j + 1; ++b) {
            for (Index c = k - 1; c <= k + 1; ++c) wide[(a * shape[1] + b) * shape[2] + c] = 1;
          }
        }
      }
    }
  }
  return wide;
}

}  // namespace

// A voxel x of block X sees a voxel t of block T only if the segment between the centres of the blocks stays in the
// widened coarse image. In units of blocks, x and t are less than 1/2 from these centres along every axis, and so is
// every point p of the coarse segment from the point q of the true one at the same share. A coarse cube that the
// segment touches at p is less than 1/2 from p, one that holds q at most 1/2 from q: their positions differ by less
// than 3/2, so by at most 1. And q is in a closed voxel of the object, so in a block that has some of it.
LabelBlocks bound_blocks(const Crop& crop, Indices voxels, Index edge, Index enough, Stop& stop, Index& n_steps) {
  Index shape[3];
  for (int a = 0; a < 3; ++a) shape[a] = (crop.shape[a] + edge - 1) / edge + 2 * kMargin;
  std::vector<Index> weights(static_cast<std::size_t>(shape[0] * shape[1] * shape[2]), 0);
  std::vector<Index> place(voxels.size());
  for (Index v = 0; v < voxels.size(); ++v) {
    Index ijk[3];
    crop.position(voxels[v], ijk);
    for (int a = 0; a < 3; ++a) ijk[a] = ijk[a] / edge + kMargin;
    place[v] = (ijk[0] * shape[1] + ijk[1]) * shape[2] + ijk[2];
    ++weights[place[v]];
  }
  const std::vector<std::uint8_t> wide = widened(weights, shape);
  const Crop coarse{wide, {shape[0], shape[1], shape[2]}, false};
  LabelView view(coarse);

  struct Block {
    Index ijk[3], place, weight;
  };
  std::vector<Block> blocks;
  std::vector<Index> number(weights.size(), -1);
  for (Index b = 0; b < static_cast<Index>(weights.size()); ++b) {
    if (weights[b] == 0) continue;
    Block block{{0, 0, 0}, b, weights[b]};
    coarse.position(b, block.ijk);
    number[b] = static_cast<Index>(blocks.size());
    blocks.push_back(block);
  }
  const Index n = static_cast<Index>(blocks.size());
  LabelBlocks found{edge, {}, std::vector<Index>(n, 0), std::vector<std::uint8_t>(static_cast<std::size_t>(n * n), 0)};
  found.of_voxel.reserve(voxels.size());
  for (const Index p : place) found.of_voxel.push_back(number[p]);
  std::vector<Index> order(n);
  for (Index t = 0; t < n; ++t) order[t] = t;
  for (Index x = 0; x < n; ++x) {
    const Block& from = blocks[x];
    Index& hidden = found.hidden[x];
    for (Index t = 0; t < n && hidden <= enough; ++t) {
      const Block& to = blocks[order[t]];
      const Index d[3] = {to.ijk[0] - from.ijk[0], to.ijk[1] - from.ijk[1], to.ijk[2] - from.ijk[2]};
      const Index before = n_steps;
      const bool is_hidden = !view.sees(from.place, d, n_steps);
      stop.poll(1 + n_steps - before);
      if (!is_hidden) continue;
      hidden += to.weight;
      found.is_hidden[x * n + order[t]] = 1;
      std::swap(order[t], order[t / 2]);
    }
  }
  return found;
}

}  // namespace voxkernel
