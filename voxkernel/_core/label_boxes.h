// The labels of a piece of an image, with the number of their voxels and their boxes.
#pragma once

#include <algorithm>
#include <unordered_map>
#include <vector>

#include "spans.h"
#include "stop.h"

namespace voxkernel {

struct LabelBoxes {
  std::vector<std::int64_t> labels;  // in order of their first voxel; 0 is no label
  std::vector<Index> sizes;
  std::vector<Index> boxes;  // six numbers each: the first voxel along every axis, then one behind the last
};

// Labels of 64 bits without a sign are taken as the signed number with the same bits.
template <typename T>
LabelBoxes label_boxes(const T* image, const Index* shape, Stop& stop) {
  LabelBoxes found;
  std::unordered_map<std::int64_t, std::size_t> row_of;
  T last = 0;
  std::size_t row = 0;
  for (Index i = 0; i < shape[0]; ++i) {
    for (Index j = 0; j < shape[1]; ++j) {
      const T* line = image + (i * shape[1] + j) * shape[2];
      stop.poll(1 + shape[2]);
      for (Index k = 0; k < shape[2];) {
        const T label = line[k];
        Index end = k + 1;
        while (end < shape[2] && line[end] == label) ++end;
        if (label != 0) {
          if (label != last) {
            const auto added = row_of.try_emplace(static_cast<std::int64_t>(label), found.labels.size());
            row = added.first->second;
            last = label;
            if (added.second) {
              found.labels.push_back(static_cast<std::int64_t>(label));
              found.sizes.push_back(0);
              for (const Index bound : {i, j, k, i + 1, j + 1, end}) found.boxes.push_back(bound);
            }
          }
          found.sizes[row] += end - k;
          Index* box = found.boxes.data() + 6 * row;
          box[1] = std::min(box[1], j);
          box[2] = std::min(box[2], k);
          box[3] = i + 1;
          box[4] = std::max(box[4], j + 1);
          box[5] = std::max(box[5], end);
        }
        k = end;
      }
    }
  }
  return found;
}

}  // namespace voxkernel
