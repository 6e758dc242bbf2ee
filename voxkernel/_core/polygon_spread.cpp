#include "polygon_spread.h"

namespace voxkernel {
namespace {

constexpr int kMostPasses = 32;

// The corner farthest from a point, and the square of the distance.
struct Farthest {
  Index at;
  double square;
};
Farthest farthest(const double* x, const double* y, const double* z, Index size, const double* point) {
  Farthest found{0, -1.0};
  for (Index k = 0; k < size; ++k) {
    const double u = x[k] - point[0], v = y[k] - point[1], w = z[k] - point[2];
    const double square = u * u + w * w + v * v;
    if (square > found.square) found = {k, square};
  }
  return found;
}

// Two corners as far from each other as any.
void pair_all(const double* x, const double* y, const double* z, Index size, Spread& spread, Stop& stop) {
  for (Index shift = 1; shift <= size / 2; ++shift) {
    stop.poll(size);
    double top = -1.0;
    Index at = 0;
    const Index n_pairs = 2 * shift == size ? shift : size;  // each once
    for (Index k = 0; k < n_pairs; ++k) {
      const double u = x[k] - x[k + shift], v = y[k] - y[k + shift], w = z[k] - z[k + shift];
      const double square = u * u + w * w + v * v;
      if (square > top) {
        top = square;
        at = k;
      }
    }
    if (top > spread.best) {
      spread.best = top;
      spread.i = at;
      spread.j = at + shift < size ? at + shift : at + shift - size;
    }
  }
}

// To go to the farthest corner from the farthest corner until that is no farther takes a few passes.
void pair_farthest(const double* x, const double* y, const double* z, Index size, Spread& spread, Stop& stop) {
  double mean[3] = {0.0, 0.0, 0.0};
  for (Index k = 0; k < size; ++k) {
    mean[0] += x[k];
    mean[1] += y[k];
    mean[2] += z[k];
  }
  for (double& value : mean) value /= static_cast<double>(size);
  Index source = farthest(x, y, z, size, mean).at;
  for (int pass = 0; pass < kMostPasses; ++pass) {
    stop.poll(size);
    const double from[3] = {x[source], y[source], z[source]};
    const Farthest found = farthest(x, y, z, size, from);
    if (!(found.square > spread.best)) return;
    spread.best = found.square;
    spread.i = source;
    spread.j = found.at;
    source = found.at;
  }
}

}  // namespace

Spread spread_corners(const double* x, const double* y, const double* z, Index size, Stop& stop) {
  Spread spread{0, 1, 0, -1.0, -1.0};
  if (size <= kMostPairedCorners) {
    pair_all(x, y, z, size, spread, stop);
  } else {
    pair_farthest(x, y, z, size, spread, stop);
  }
  const Index i = spread.i, j = spread.j;
  const double ux = x[j] - x[i], uy = y[j] - y[i], uz = z[j] - z[i];
  for (Index k = 0; k < size; ++k) {
    const double vx = x[k] - x[i], vy = y[k] - y[i], vz = z[k] - z[i];
    const double cx = uy * vz - uz * vy, cy = uz * vx - ux * vz, cz = ux * vy - uy * vx;
    const double square = cx * cx + cz * cz + cy * cy;
    if (square > spread.square) {
      spread.square = square;
      spread.far = k;
    }
  }
  return spread;
}

}  // namespace voxkernel
