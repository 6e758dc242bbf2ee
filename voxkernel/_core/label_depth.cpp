#include "label_depth.h"

#include <algorithm>
#include <limits>
#include <vector>

namespace voxkernel {
namespace {

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

// Along the last axis background is everywhere near, so that counting from both ends will do.
void first_axis(const std::uint8_t* bytes, double* row, Index n, double spacing) {
  Index run = 0;
  for (Index k = 0; k < n; ++k) {
    run = bytes[k] != 0 ? run + 1 : 0;
    row[k] = static_cast<double>(run);
  }
  run = 0;
  for (Index k = n - 1; k >= 0; --k) {
    run = bytes[k] != 0 ? run + 1 : 0;
    const double d = std::min(row[k], static_cast<double>(run)) * spacing;
    row[k] = d * d;
  }
}

}  // namespace

void squared_depths(const Crop& crop, const double* spacing, Span<double> depths, Stop& stop) {
  const Index ni = crop.shape[0], nj = crop.shape[1], nk = crop.shape[2];
  for (Index row = 0; row < ni * nj; ++row) {
    first_axis(crop.bytes.data() + row * nk, depths.data() + row * nk, nk, spacing[2]);
    stop.poll(nk);
  }
  Envelope envelope(std::max(ni, nj));
  for (Index i = 0; i < ni; ++i) {
    for (Index k = 1; k < nk - 1; ++k) envelope.transform(depths.data() + i * nj * nk + k, nj, nk, spacing[1]);
    stop.poll(4 * nj * nk);
  }
  if (crop.is_flat) return;
  for (Index j = 1; j < nj - 1; ++j) {
    for (Index k = 1; k < nk - 1; ++k) envelope.transform(depths.data() + j * nk + k, ni, nj * nk, spacing[0]);
    stop.poll(4 * ni * nk);
  }
}

}  // namespace voxkernel
