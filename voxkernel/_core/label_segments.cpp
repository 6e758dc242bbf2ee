#include "label_segments.h"

namespace voxkernel {

// The walk runs in an array that just holds both ends.
std::vector<Index> touched_voxels(const Index* from, const Index* to) {
  Index low[3], shape[3], d[3], strides[3];
  for (int a = 0; a < 3; ++a) {
    low[a] = from[a] < to[a] ? from[a] : to[a];
    d[a] = to[a] - from[a];
    shape[a] = (d[a] < 0 ? -d[a] : d[a]) + 1;
  }
  strides[0] = shape[1] * shape[2];
  strides[1] = shape[2];
  strides[2] = 1;
  const Index start = (from[0] - low[0]) * strides[0] + (from[1] - low[1]) * strides[1] + (from[2] - low[2]);
  std::vector<Index> found{from[0], from[1], from[2]};
  SegmentWalk walk(start, d, strides);
  while (walk.advance()) {
    const Index v = walk.at();
    found.push_back(low[0] + v / strides[0]);
    found.push_back(low[1] + v / shape[2] % shape[1]);
    found.push_back(low[2] + v % shape[2]);
  }
  return found;
}

}  // namespace voxkernel
