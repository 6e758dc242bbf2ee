#include "label_depth.h"

#include <algorithm>
#include <cstring>
#include <limits>
#include <numeric>
#include <vector>

namespace voxkernel {
namespace {

constexpr Index kSmall = Index{1} << 20;  // voxels, for which eight bytes each do no harm
constexpr Index kSlab = Index{1} << 21;   // voxels that are worked on at once
constexpr double kFar = std::numeric_limits<double>::infinity();

// Lower envelope of parabolas, one a voxel of a line (Felzenszwalb and Huttenlocher 2012).
class Envelope {
 public:
  explicit Envelope(Index most) : values_(most), vertex_(most), from_(most + 1) {}

  // Of a line only stretches of the object matter, each with the voxel outside before and after it: those farther away
  // are never nearer.
  void transform(double* line, Index n, Index stride, double spacing) {
    for (Index q = 1; q < n; ++q) {
      if (line[q * stride] == 0.0) continue;
      Index last = q + 1;
      while (last < n - 1 && line[last * stride] != 0.0) ++last;
      stretch(line, q - 1, last, stride, spacing);
      q = last;
    }
  }

 private:
  void stretch(double* line, Index first, Index last, Index stride, double spacing) {
    const double square = spacing * spacing;
    Index top = -1;
    for (Index q = first; q <= last; ++q) {
      const double value = line[q * stride];
      values_[q] = value;
      double from = -kFar;
      while (top >= 0) {
        const Index v = vertex_[top];
        const double gap = static_cast<double>(q - v);
        from = 0.5 * ((value - values_[v]) / (square * gap) + static_cast<double>(q + v));
        if (from > from_[top]) break;
        --top;
      }
      if (top < 0) from = -kFar;
      ++top;
      vertex_[top] = q;
      from_[top] = from;
    }
    from_[top + 1] = kFar;
    Index at = 0;
    for (Index q = first + 1; q < last; ++q) {
      while (from_[at + 1] < static_cast<double>(q)) ++at;
      const double gap = static_cast<double>(q - vertex_[at]) * spacing;
      line[q * stride] = gap * gap + values_[vertex_[at]];
    }
  }

  std::vector<double> values_;
  std::vector<Index> vertex_;
  std::vector<double> from_;
};

// The next voxel of the object in a row, from one on; n where there is none.
Index next_voxel(const std::uint8_t* bytes, Index from, Index n) {
  constexpr Index kAtOnce = 8;
  std::uint64_t eight;
  for (; from + kAtOnce <= n; from += kAtOnce) {
    std::memcpy(&eight, bytes + from, sizeof eight);
    if (eight != 0) break;
  }
  while (from < n && bytes[from] == 0) ++from;
  return from;
}

// Along the last axis background is everywhere near, so that counting from both ends of each stretch of the object will
// do.
void first_axis(const std::uint8_t* bytes, double* row, Index n, double spacing) {
  std::fill_n(row, n, 0.0);
  for (Index k = next_voxel(bytes, 0, n); k < n; k = next_voxel(bytes, k, n)) {
    Index last = k;
    while (last < n && bytes[last] != 0) ++last;
    for (Index q = k; q < last; ++q) {
      const double d = static_cast<double>(std::min(q + 1 - k, last - q)) * spacing;
      row[q] = d * d;
    }
    k = last;
  }
}

// Lines of n voxels that lie side by side, `width` of them: voxels at the same distance along all lines in turn, until
// they cannot be nearer than what is known. Faster than the envelope where objects are not deep.
class SideBySide {
 public:
  // Whether no voxel is deeper than the largest distance that is worth it. The first and the last voxels are outside.
  static bool is_shallow(const double* lines, Index n, Index stride, Index width, double spacing) {
    const double deep = kDeep * spacing;
    for (Index q = 1; q < n - 1; ++q) {
      if (largest(lines + q * stride, width) > deep * deep) return false;
    }
    return true;
  }
  void transform(double* lines, Index n, Index stride, Index width, double spacing) {
    before_.resize(static_cast<std::size_t>(n * width));
    for (Index q = 0; q < n; ++q) std::copy_n(lines + q * stride, width, before_.data() + q * width);
    for (Index q = 1; q < n - 1; ++q) {
      double* const own = lines + q * stride;
      double most = largest(own, width);
      for (Index gap = 1;; ++gap) {
        const double distance = static_cast<double>(gap) * spacing, square = distance * distance;
        if (square >= most) break;
        const double* const low = before_.data() + (q - gap) * width;
        const double* const high = before_.data() + (q + gap) * width;
        for (Index k = 0; k < width; ++k) own[k] = std::min(own[k], square + std::min(low[k], high[k]));
        most = largest(own, width);
      }
    }
  }

 private:
  static constexpr double kDeep = 32.0;

  // Eight at a time: in one chain each would wait for the one before it.
  static double largest(const double* values, Index n) {
    constexpr Index kChains = 8;
    double most[kChains] = {};
    Index k = 0;
    for (; k + kChains <= n; k += kChains) {
      for (Index c = 0; c < kChains; ++c) most[c] = std::max(most[c], values[k + c]);
    }
    for (; k < n; ++k) most[0] = std::max(most[0], values[k]);
    return *std::max_element(most, most + kChains);
  }

  std::vector<double> before_;
};

// The other two axes of a slab of `n` layers along the last one, all of which are known along that.
void other_axes(const Crop& crop, const double* spacing, double* slab, Index n, Stop& stop) {
  const Index ni = crop.shape[0], nj = crop.shape[1];
  Envelope envelope(std::max(ni, nj));
  SideBySide side_by_side;
  const auto transform = [&](double* lines, Index length, Index stride, double gap) {
    if (SideBySide::is_shallow(lines, length, stride, n, gap)) {
      side_by_side.transform(lines, length, stride, n, gap);
    } else {
      for (Index k = 0; k < n; ++k) envelope.transform(lines + k, length, stride, gap);
    }
    stop.poll(4 * length * n);
  };
  for (Index i = 0; i < ni; ++i) transform(slab + i * nj * n, nj, n, spacing[1]);
  if (crop.is_flat) return;
  for (Index j = 1; j < nj - 1; ++j) transform(slab + j * n, ni, nj * n, spacing[0]);
}

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
  const Index ni = crop.shape[0], nj = crop.shape[1], nk = crop.shape[2];
  for (Index row = 0; row < ni * nj; ++row) {
    first_axis(crop.bytes.data() + row * nk, depths.data() + row * nk, nk, spacing[2]);
    stop.poll(nk);
  }
  other_axes(crop, spacing, depths.data(), nk, stop);
}

Depths::Depths(const Crop& crop, const double* spacing, Stop& stop) {
  if (crop.size() <= kSmall) {
    own_.resize(static_cast<std::size_t>(crop.size()));
    squared_depths(crop, spacing, own_, stop);
    squares_ = own_;
    return;
  }
  const Index ni = crop.shape[0], nj = crop.shape[1], nk = crop.shape[2];
  const Index width = std::max<Index>(1, std::min(nk, kSlab / (ni * nj)));
  std::vector<double> slab(static_cast<std::size_t>(ni * nj * width)), row(static_cast<std::size_t>(nk));
  narrow_.resize(static_cast<std::size_t>(crop.size()));
  Numbers numbers;
  for (Index first = 0; first < nk; first += width) {
    const Index n = std::min(width, nk - first);
    for (Index r = 0; r < ni * nj; ++r) {
      first_axis(crop.bytes.data() + r * nk, row.data(), nk, spacing[2]);
      std::copy_n(row.data() + first, n, slab.data() + r * n);
      stop.poll(nk);
    }
    other_axes(crop, spacing, slab.data(), n, stop);
    for (Index r = 0; r < ni * nj; ++r) {
      for (Index k = 0; k < n; ++k) {
        const Index voxel = r * nk + first + k;
        if (crop.bytes[voxel] != 0) set(voxel, numbers.of(slab[r * n + k]));
      }
      stop.poll(n);
    }
  }
  std::vector<double>().swap(slab);
  sort_places(numbers.values(), stop);
}

void Depths::set(Index voxel, std::uint32_t place) {
  if (wide_.empty() && place > UINT16_MAX) {
    wide_.assign(narrow_.begin(), narrow_.end());
    std::vector<std::uint16_t>().swap(narrow_);
  }
  if (wide_.empty()) {
    narrow_[voxel] = static_cast<std::uint16_t>(place);
  } else {
    wide_[voxel] = place;
  }
}

// From numbers in the order they came to places in the order of the depths.
void Depths::sort_places(std::vector<double>& values, Stop& stop) {
  std::vector<std::uint32_t> order(values.size()), places(values.size() + 1, 0);
  std::iota(order.begin(), order.end(), std::uint32_t{0});
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) { return values[a] < values[b]; });
  for (std::size_t k = 0; k < order.size(); ++k) places[order[k] + 1] = static_cast<std::uint32_t>(k + 1);
  for (std::uint16_t& place : narrow_) place = static_cast<std::uint16_t>(places[place]);
  for (std::uint32_t& place : wide_) place = places[place];
  stop.poll(static_cast<Index>(narrow_.size() + wide_.size()));
}

}  // namespace voxkernel
