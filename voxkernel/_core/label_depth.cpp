#include "label_depth.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numeric>

namespace voxkernel {
namespace {

constexpr Index kSmall = Index{1} << 20;   // voxels, for which eight bytes each do no harm
constexpr Index kSlab = Index{1} << 20;    // voxels that are worked on at once
constexpr Index kLayers = Index{1} << 21;  // numbers of layers that are kept
constexpr Index kKnown = Index{1} << 12;   // depths of single voxels that are kept
// Of a depth, relative, far more than rounding can do: two parabolas that are taken for each other near the point where
// they meet differ there by less than 2^-28 of their height, for each of two axes.
constexpr double kMargin = 1e-6;

// Numbers numbers as they come, from 1: a table with open places.
class Numbers {
 public:
  std::uint32_t of(double value) {
    if (2 * values_.size() >= table_.size()) grow();
    std::uint32_t& place = table_[find(value)];
    if (place == 0) {
      values_.push_back(value);
      place = static_cast<std::uint32_t>(values_.size());
    }
    return place;
  }
  std::vector<double>& values() { return values_; }

 private:
  static constexpr std::uint64_t kMixing = 0x9E3779B97F4A7C15u;

  std::size_t find(double value) const {
    std::uint64_t bits;
    std::memcpy(&bits, &value, sizeof bits);
    const std::size_t mask = table_.size() - 1;
    bits *= kMixing;  // the low bits of most numbers are 0
    std::size_t at = static_cast<std::size_t>((bits ^ bits >> 32) * kMixing >> 32) & mask;
    while (table_[at] != 0 && values_[table_[at] - 1] != value) at = (at + 1) & mask;
    return at;
  }
  void grow() {
    table_.assign(2 * table_.size(), 0);
    for (std::size_t k = 0; k < values_.size(); ++k) table_[find(values_[k])] = static_cast<std::uint32_t>(k + 1);
  }

  std::vector<double> values_;
  std::vector<std::uint32_t> table_ = std::vector<std::uint32_t>(1024, 0);
};

}  // namespace

void squared_depths(const Crop& crop, const double* spacing, Span<double> depths, Stop& stop) {
  DepthLayers(crop, spacing).fill(0, crop.shape[2], depths.data(), stop);
}

Depths::Depths(const Crop& crop, const double* spacing, Stop& stop) {
  if (crop.size() > kSmall) {
    cubes_ = std::make_unique<DeepestVoxels>(crop, spacing, stop);
    return;
  }
  own_.resize(static_cast<std::size_t>(crop.size()));
  squared_depths(crop, spacing, own_, stop);
  squares_ = own_;
}

DeepestVoxels::DeepestVoxels(const Crop& crop, const double* spacing, Stop& stop)
    : crop_(crop), spacing_{spacing[0], spacing[1], spacing[2]}, again_(crop, spacing) {
  Index n_cubes = 1;
  for (int a = 0; a < 3; ++a) {
    shape_[a] = (crop.shape[a] + kEdge - 1) / kEdge;
    n_cubes *= shape_[a];
  }
  places_.assign(static_cast<std::size_t>(n_cubes), 0);
  at_.assign(static_cast<std::size_t>(n_cubes), 0);
  const Index ni = crop.shape[0], nj = crop.shape[1], nk = crop.shape[2];
  const Index width = std::max<Index>(1, kSlab / (ni * nj * kEdge)) * kEdge;
  Numbers numbers;
  Brief<double> slab(static_cast<std::size_t>(ni * nj * std::min(width, nk)));
  for (Index first = 0; first < nk; first += width) {
    const Index n = std::min(width, nk - first);
    again_.fill(first, n, slab.data(), stop);
    for (Index i = 0; i < ni; i += kEdge) {
      for (Index j = 0; j < nj; j += kEdge) {
        for (Index k = 0; k < n; k += kEdge) {
          double most = 0.0;
          Index at = 0;
          for (Index di = 0; di < std::min(kEdge, ni - i); ++di) {
            for (Index dj = 0; dj < std::min(kEdge, nj - j); ++dj) {
              const double* row = slab.data() + ((i + di) * nj + j + dj) * n + k;
              for (Index dk = 0; dk < std::min(kEdge, n - k); ++dk) {
                if (row[dk] <= most) continue;
                most = row[dk];
                at = (di * kEdge + dj) * kEdge + dk;
              }
            }
          }
          if (most == 0.0) continue;
          const Index ijk[3] = {i, j, first + k};
          const Index cube = cube_of(ijk);
          places_[cube] = numbers.of(most);
          at_[cube] = static_cast<std::uint8_t>(at);
        }
      }
      stop.poll(kEdge * nj * n);
    }
  }
  // From numbers in the order they came to places in the order of the depths.
  const std::vector<double>& values = numbers.values();
  std::vector<std::uint32_t> order(values.size()), places(values.size() + 1, 0);
  std::iota(order.begin(), order.end(), std::uint32_t{0});
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) { return values[a] < values[b]; });
  depths_.reserve(values.size());
  for (const std::uint32_t number : order) {
    depths_.push_back(values[number]);
    places[number + 1] = static_cast<std::uint32_t>(depths_.size());
  }
  for (std::uint32_t& place : places_) place = places[place];
  known_.resize(static_cast<std::size_t>(kKnown));
  layers_.reserve(static_cast<std::size_t>(std::max<Index>(kEdge + 1, std::min(nk, kLayers / (ni * nj)))));
}

Index DeepestVoxels::cube_of(const Index* ijk) const {
  return (ijk[0] / kEdge * shape_[1] + ijk[1] / kEdge) * shape_[2] + ijk[2] / kEdge;
}

Index DeepestVoxels::voxel_of(Index cube) const {
  const Index at = at_[cube], row = cube / shape_[2];
  return crop_.flat(row / shape_[1] * kEdge + at / (kEdge * kEdge), row % shape_[1] * kEdge + at / kEdge % kEdge,
                    cube % shape_[2] * kEdge + at % kEdge);
}

DeepestVoxels::Found DeepestVoxels::find(const Index* low, const Index* high) const {
  Index first[3], last[3];
  for (int a = 0; a < 3; ++a) {
    first[a] = low[a] / kEdge;
    last[a] = std::min(shape_[a], (high[a] + kEdge - 1) / kEdge);
  }
  Found found{0, 0};
  for (Index i = first[0]; i < last[0]; ++i) {
    for (Index j = first[1]; j < last[1]; ++j) {
      for (Index k = first[2]; k < last[2]; ++k) {
        const Index cube = (i * shape_[1] + j) * shape_[2] + k, place = places_[cube];
        if (place == 0 || place < found.place) continue;
        const Index voxel = voxel_of(cube);
        if (place > found.place || voxel < found.voxel) found = {place, voxel};
      }
    }
  }
  return found;
}

// Depths, not squared, differ by no more than voxels are apart; none in a cube is greater than that of its deepest.
DeepestVoxels::Bounds DeepestVoxels::bounds_of(Index voxel) const {
  Index ijk[3], deepest[3];
  crop_.position(voxel, ijk);
  const Index cube = cube_of(ijk);
  const double most = depths_[places_[cube] - 1];
  const Index other = voxel_of(cube);
  if (other == voxel) return {most, most};
  const Known& known = known_[voxel % kKnown];
  if (known.voxel == voxel) return {known.depth, known.depth};
  crop_.position(other, deepest);
  double square = 0.0;
  for (int a = crop_.is_flat ? 1 : 0; a < 3; ++a) {
    const double d = static_cast<double>(ijk[a] - deepest[a]) * spacing_[a];
    square += d * d;
  }
  const double least = std::max(0.0, std::sqrt(most) * (1.0 - kMargin) - std::sqrt(square) * (1.0 + kMargin));
  return {least * least * (1.0 - kMargin), most};
}

bool DeepestVoxels::is_deeper(Index a, Index b) {
  const Bounds of_a = bounds_of(a), of_b = bounds_of(b);
  if (of_a.low > of_b.high) return true;
  if (of_a.high < of_b.low) return false;
  const double depth_a = of_a.low == of_a.high ? of_a.low : depth_of(a);
  const double depth_b = of_b.low == of_b.high ? of_b.low : depth_of(b);
  return depth_a != depth_b ? depth_a > depth_b : a < b;
}

double DeepestVoxels::depth_of(Index voxel) {
  const Index nk = crop_.shape[2];
  const double depth = layer(voxel % nk)[voxel / nk];
  known_[voxel % kKnown] = {voxel, depth};
  return depth;
}

// Squared depths of one layer; the one that was not used for longest makes room.
const double* DeepestVoxels::layer(Index k) {
  Layer* oldest = nullptr;
  for (Layer& layer : layers_) {
    if (layer.k == k) {
      layer.last_use = ++n_uses_;
      return layer.depths.data();
    }
    if (oldest == nullptr || layer.last_use < oldest->last_use) oldest = &layer;
  }
  if (oldest == nullptr || layers_.size() < layers_.capacity()) {
    layers_.push_back({0, 0, Brief<double>(static_cast<std::size_t>(crop_.shape[0] * crop_.shape[1]))});
    oldest = &layers_.back();
  }
  Stop stop;
  again_.fill(k, 1, oldest->depths.data(), stop);
  oldest->k = k;
  oldest->last_use = ++n_uses_;
  return oldest->depths.data();
}

}  // namespace voxkernel
