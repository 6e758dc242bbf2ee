#include "cell_gather.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace voxkernel {

CellSizes largest_sizes(const CellMesh& mesh, Index first, Index last) {
  CellSizes most;
  for (Index cell = first; cell < last; ++cell) {
    const Index low = mesh.cell_offsets[cell], high = mesh.cell_offsets[cell + 1];
    Index corners = 0;
    for (Index at = low; at < high; ++at) {
      const Index f = mesh.cell_faces[at];
      corners += mesh.face_offsets[f + 1] - mesh.face_offsets[f];
    }
    most.faces = std::max(most.faces, high - low);
    most.corners = std::max(most.corners, corners);
  }
  return most;
}

Cell::Cell(const CellMesh& mesh, CellSizes largest)
    : ring(largest.corners),
      start(largest.faces + 1),
      apex(largest.faces),
      raw(3 * largest.corners),
      number_(mesh.vertices.size(), -1),
      used_(largest.corners) {}

bool Cell::gather(const CellMesh& mesh, Span<const bool> flips, Index cell) {
  const Index low = mesh.cell_offsets[cell], high = mesh.cell_offsets[cell + 1];
  n_faces = high - low;
  n_vertices = 0;
  Index n = 0;
  bool is_good = n_faces > 0;
  for (Index at = low; at < high; ++at) {
    const Index f = mesh.cell_faces[at];
    const Index begin = mesh.face_offsets[f], size = mesh.face_offsets[f + 1] - begin;
    const Indices corners = mesh.face_vertices.part(begin, begin + size);
    const bool flip = flips[at];
    start[at - low] = n;
    if (size < 3) is_good = false;
    for (Index k = 0; k < size; ++k) {
      const Index v = corners[flip ? size - 1 - k : k];
      if (number_[v] < 0) {
        number_[v] = n_vertices;
        used_[n_vertices] = v;
        std::copy_n(mesh.vertices[v], 3, raw.data() + 3 * n_vertices);
        ++n_vertices;
      }
      ring[n++] = number_[v];
    }
  }
  start[n_faces] = n;
  for (Index v = 0; v < n_vertices; ++v) number_[used_[v]] = -1;
  return is_good;
}

Frame local_frame(Points points) {
  Frame frame{0.0, 0.0, {0.0, 0.0, 0.0}};
  double square = 0.0;
  for (int axis = 0; axis < 3; ++axis) {
    double low = points(0, axis), high = low;
    for (Index v = 0; v < points.size(); ++v) {
      const double value = points(v, axis);
      if (!std::isfinite(value)) return {0.0, std::numeric_limits<double>::infinity(), {0.0, 0.0, 0.0}};
      low = std::min(low, value);
      high = std::max(high, value);
      frame.largest = std::max(frame.largest, std::abs(value));
    }
    const double middle = low + 0.5 * (high - low);
    const double half = std::max(high - middle, middle - low);
    frame.origin[axis] = middle;
    square += half * half;
  }
  const double reach = std::sqrt(square) * (1.0 + 1e-12);
  if (!(kSmallest < reach && reach < kLargest)) {
    frame.scale = -1.0;
    return frame;
  }
  int exponent = 0;
  std::frexp(reach, &exponent);
  frame.scale = std::ldexp(1.0, exponent);
  return frame;
}

}  // namespace voxkernel
