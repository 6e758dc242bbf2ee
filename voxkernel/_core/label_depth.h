// Squared distance of every voxel of an object from the nearest voxel outside, centre to centre.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "depth_layers.h"
#include "label_crop.h"
#include "object_centroid.h"
#include "pages.h"
#include "spans.h"
#include "stop.h"

namespace voxkernel {

// Euclidean distances in world units, exact but for rounding; 0 outside.
void squared_depths(const Crop& crop, const double* spacing, Span<double> depths, Stop& stop);

// Of each cube of an object the deepest voxel, which takes five bytes a cube; squared depths of others are found again,
// a layer at a time, where bounds by the deepest one nearby do not tell.
class DeepestVoxels {
 public:
  static constexpr Index kEdge = 3;  // of a cube; they start at voxel 0

  DeepestVoxels(const Crop& crop, const double* spacing, const CentroidOrder& nearness, Stop& stop);

  bool is_deeper(Index a, Index b);
  struct Found {
    Index place, voxel;  // the place of its depth among those of the deepest voxels; 0 where there is no voxel
  };
  // Of a box of cubes, from voxel `low` on and before `high`.
  Found find(const Index* low, const Index* high) const;

 private:
  struct Bounds {
    double low, high;
  };
  struct Layer {
    Index k;
    Index last_use;
    Brief<double> depths;
  };
  struct Known {
    Index voxel = -1;
    double depth = 0.0;
  };

  Index cube_of(const Index* ijk) const;
  Index voxel_of(Index cube) const;
  Bounds bounds_of(Index voxel) const;
  double depth_of(Index voxel);
  const double* layer(Index k);

  Crop crop_;
  const CentroidOrder& nearness_;
  double spacing_[3];
  Index shape_[3];               // in cubes
  Brief<std::uint32_t> places_;  // of each cube, 0 where there is no voxel of the object
  Brief<std::uint8_t> at_;       // where in the cube
  std::vector<double> depths_;   // of places from 1 on, growing
  DepthLayers again_;
  std::vector<Layer> layers_;  // those asked for last
  std::vector<Known> known_;   // voxels asked for last
  Index n_uses_ = 0;
};

// Tells which of two voxels of an object is deeper; of two that are equally deep, the one nearer to the centroid, then
// the first.
class Depths {
 public:
  // Squared depths from elsewhere, which have to live on, as has the crop.
  Depths(const Crop& crop, const double* spacing, Doubles squares) : nearness_(crop, spacing), squares_(squares) {}
  // The crop has to live on. Eight bytes a voxel for a small one.
  Depths(const Crop& crop, const double* spacing, Stop& stop);

  Depths(const Depths&) = delete;
  Depths& operator=(const Depths&) = delete;

  bool is_deeper(Index a, Index b) const {
    if (cubes_ != nullptr) return cubes_->is_deeper(a, b);
    return squares_[a] != squares_[b] ? squares_[a] > squares_[b] : nearness_.is_nearer(a, b);
  }
  // None for a small crop.
  const DeepestVoxels* cubes() const { return cubes_.get(); }

 private:
  CentroidOrder nearness_;
  std::vector<double> own_;
  Doubles squares_;
  std::unique_ptr<DeepestVoxels> cubes_;
};

}  // namespace voxkernel
