// One polyhedral cell out of many, in its own numbers and its own frame.
#pragma once

#include <vector>

#include "spans.h"

namespace voxkernel {

// Faces that cells share: corners of face f are face_vertices[face_offsets[f] ..], faces of cell c are
// cell_faces[cell_offsets[c] ..].
struct CellMesh {
  Points vertices;
  Indices face_offsets, face_vertices, cell_offsets, cell_faces;
};

struct CellSizes {
  Index faces = 0, corners = 0;
};

// Most faces and most corners of any of the cells first .. last - 1.
CellSizes largest_sizes(const CellMesh& mesh, Index first, Index last);

// The faces of a cell: face f has the corners ring[start[f]] .. ring[start[f + 1] - 1]. `apex` is the corner of a
// face, counted from its first, about which the face is a fan of triangles.
struct Polygons {
  Index n_faces;
  Indices ring, start, apex;
};

// A cell with its own vertex numbers, in the order of their first use. Its memory serves one cell after the other.
class Cell {
 public:
  Cell(const CellMesh& mesh, CellSizes largest);

  // Copies a cell, faces turned as they are used; false where a face has fewer than 3 corners, or there is no face.
  bool gather(const CellMesh& mesh, Span<const bool> flips, Index cell);

  Index n_faces = 0, n_vertices = 0;
  std::vector<Index> ring, start, apex;
  std::vector<double> raw;  // the coordinates of the mesh

  Points points() const { return {raw.data(), n_vertices}; }
  Polygons polygons() const { return {n_faces, ring, start, apex}; }

 private:
  std::vector<Index> number_;  // of each vertex of the mesh, -1 but while `gather` runs
  std::vector<Index> used_;    // the vertices of the cell, as the mesh numbers them
};

constexpr double kLargest = 0x1p150, kSmallest = 0x1p-150;

// The middle of the bounding box, and a power of two that covers the cell from there: 0 where a coordinate is not
// finite, -1 where the cell is too large or too small for floating point. `largest` is the largest magnitude.
struct Frame {
  double scale, largest;
  double origin[3];
};
Frame local_frame(Points points);

}  // namespace voxkernel
