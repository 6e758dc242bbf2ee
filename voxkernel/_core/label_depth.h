// Squared distance of every voxel of an object from the nearest voxel outside, centre to centre.
#pragma once

#include <cstdint>
#include <vector>

#include "label_crop.h"
#include "spans.h"
#include "stop.h"

namespace voxkernel {

// Exact Euclidean distances in world units; 0 outside. A flat crop is measured along its last two axes.
void squared_depths(const Crop& crop, const double* spacing, Span<double> depths, Stop& stop);

// Tells which of two voxels of an object is deeper: by their squared depths, or, for a large object, by the places of
// these among all that occur, which take two bytes a voxel, or four, where more than 65,535 of them occur.
class Depths {
 public:
  // Squared depths from elsewhere, which have to live on.
  explicit Depths(Doubles squares) : squares_(squares) {}
  Depths(const Crop& crop, const double* spacing, Stop& stop);

  Depths(const Depths&) = delete;
  Depths& operator=(const Depths&) = delete;

  double operator[](Index voxel) const { return !has_places() ? squares_[voxel] : static_cast<double>(place(voxel)); }
  bool has_places() const { return squares_.size() == 0; }
  // 0 outside; larger for deeper voxels.
  Index place(Index voxel) const {
    return !narrow_.empty() ? static_cast<Index>(narrow_[voxel]) : static_cast<Index>(wide_[voxel]);
  }

 private:
  void set(Index voxel, std::uint32_t place);
  void sort_places(std::vector<double>& values, Stop& stop);

  std::vector<double> own_;
  Doubles squares_;
  std::vector<std::uint16_t> narrow_;
  std::vector<std::uint32_t> wide_;
};

}  // namespace voxkernel
