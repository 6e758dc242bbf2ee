#include "depth_layers.h"

#include <algorithm>
#include <cstring>
#include <limits>

namespace voxkernel {
namespace {

constexpr double kFar = std::numeric_limits<double>::infinity();
constexpr Index kSmall = Index{1} << 20;  // voxels of crops that are always filled as a whole
constexpr Index kNear = Index{1} << 15;   // numbers that are at hand wherever they lie

// How many voxels of a row are of the object, from one on and from one back.
Index run_from(const std::uint8_t* row, Index k, Index n) {
  if (k >= n || row[k] == 0) return 0;
  const void* end = std::memchr(row + k, 0, static_cast<std::size_t>(n - k));
  return end == nullptr ? n - k : static_cast<const std::uint8_t*>(end) - (row + k);
}
Index run_before(const std::uint8_t* row, Index k) {
  constexpr std::uint64_t ones = 0x0101010101010101u, highs = 0x8080808080808080u;
  const Index end = k;
  std::uint64_t word;
  for (; k >= 8; k -= 8) {
    std::memcpy(&word, row + k - 8, 8);
    if (((word - ones) & ~word & highs) != 0) break;
  }
  while (k > 0 && row[k - 1] != 0) --k;
  return end - k;
}

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

// A row of squared depths along itself: background is near everywhere, so that counting from both ends of each stretch
// of the object will do.
void whole_row(const std::uint8_t* bytes, double* row, Index n, double spacing) {
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

}  // namespace

void Envelope::transform(double* line, Index n, Index stride, double spacing) {
  for (Index q = 1; q < n; ++q) {
    if (line[q * stride] == 0.0) continue;
    Index last = q + 1;
    while (last < n - 1 && line[last * stride] != 0.0) ++last;
    stretch(line, q - 1, last, stride, spacing);
    q = last;
  }
}

void Envelope::stretch(double* line, Index first, Index last, Index stride, double spacing) {
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

DepthLayers::DepthLayers(const Crop& crop, const double* spacing)
    : crop_(crop),
      spacing_{spacing[0], spacing[1], spacing[2]},
      envelope_(std::max(crop.shape[0], crop.shape[1])),
      runs_(static_cast<std::size_t>(crop.shape[0] * crop.shape[1]), 0) {}

void DepthLayers::along_rows(Index first, Index n, double* slab, Stop& stop) {
  const Index nk = crop_.shape[2], n_rows = crop_.shape[0] * crop_.shape[1];
  if (n == nk) {
    for (Index r = 0; r < n_rows; ++r) {
      whole_row(crop_.bytes.data() + r * nk, slab + r * nk, nk, spacing_[2]);
      stop.poll(nk);
    }
    return;
  }
  for (Index r = 0; r < n_rows; ++r) {
    const std::uint8_t* bytes = crop_.bytes.data() + r * nk;
    double* row = slab + r * n;
    Index run = first == next_ ? runs_[r] : run_before(bytes, first);
    for (Index k = 0; k < n; ++k) {
      run = bytes[first + k] != 0 ? run + 1 : 0;
      row[k] = static_cast<double>(run);
    }
    runs_[r] = static_cast<std::int32_t>(run);
    run = run == 0 ? 0 : run_from(bytes, first + n, nk);
    for (Index k = n - 1; k >= 0; --k) {
      run = bytes[first + k] != 0 ? run + 1 : 0;
      const double d = std::min(row[k], static_cast<double>(run)) * spacing_[2];
      row[k] = d * d;
    }
    stop.poll(2 * n + 8);
  }
  next_ = first + n;
}

void DepthLayers::fill(Index first, Index n, double* slab, Stop& stop) {
  along_rows(first, n, slab, stop);
  const Index ni = crop_.shape[0], nj = crop_.shape[1];
  SideBySide side_by_side;
  const auto is_side_by_side = [&](const double* lines, Index length, Index stride, double gap) {
    return crop_.size() <= kSmall && SideBySide::is_shallow(lines, length, stride, n, gap);
  };
  for (Index i = 0; i < ni; ++i) {
    double* lines = slab + i * nj * n;
    stop.poll(4 * nj * n);
    if (is_side_by_side(lines, nj, n, spacing_[1])) {
      side_by_side.transform(lines, nj, n, n, spacing_[1]);
      continue;
    }
    for (Index k = 0; k < n; ++k) envelope_.transform(lines + k, nj, n, spacing_[1]);
  }
  if (crop_.is_flat) return;
  for (Index j = 1; j < nj - 1; ++j) {
    double* lines = slab + j * n;
    stop.poll(4 * ni * n);
    if (is_side_by_side(lines, ni, nj * n, spacing_[0])) {
      side_by_side.transform(lines, ni, nj * n, n, spacing_[0]);
      continue;
    }
    if (ni * nj * n <= kNear) {
      for (Index k = 0; k < n; ++k) envelope_.transform(lines + k, ni, nj * n, spacing_[0]);
      continue;
    }
    line_.resize(static_cast<std::size_t>(ni * n));
    for (Index i = 0; i < ni; ++i) {
      for (Index k = 0; k < n; ++k) line_[k * ni + i] = lines[i * nj * n + k];
    }
    for (Index k = 0; k < n; ++k) envelope_.transform(line_.data() + k * ni, ni, 1, spacing_[0]);
    for (Index i = 0; i < ni; ++i) {
      for (Index k = 0; k < n; ++k) lines[i * nj * n + k] = line_[k * ni + i];
    }
  }
}

}  // namespace voxkernel
