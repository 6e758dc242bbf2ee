// The kernel of one small cell: proof that it is empty, proof that it is the cell, its volume otherwise.
#pragma once

#include <cstdint>
#include <vector>

#include "cell_gather.h"
#include "cell_planes.h"
#include "deepest_point.h"
#include "spans.h"

namespace voxkernel {

// Whether four planes in general position certainly have no common inner point.
bool proves_empty(const HalfSpaceColumns& planes, const Index* ids);

// Whether planes that are nearly parallel exclude each other in a ball, and the kernel reaches no farther.
bool proves_empty_near(const HalfSpaceColumns& planes, double volume, double area, const DeepestPoint& deepest);

// Largest n . v - d over all planes and vertices, and whether every vertex certainly is behind every plane.
struct Convexity {
  double excess;
  bool is_convex;
};
class ConvexityTest {
 public:
  explicit ConvexityTest(Index most_corners)
      : own_(most_corners), x_(most_corners), y_(most_corners), z_(most_corners), values_(most_corners) {}
  Convexity test(const Cell& cell, Points local, const PolygonPlanes& polygons, const HalfSpaceColumns& planes,
                 Stop& stop);

 private:
  std::vector<Index> own_;
  std::vector<double> x_, y_, z_, values_;
};

// Cuts the faces of a kernel out of their planes.
class FaceCutter {
 public:
  explicit FaceCutter(Index most);

  // Volume of the kernel about a point inside it, its extent, and how badly its faces fit together: a negative misfit
  // means that a face has no end.
  struct Solid {
    double volume, extent, misfit;
  };
  // `box`, where it is asked for, becomes the lower, then the upper corner of the kernel relative to the centre.
  Solid cut(const HalfSpaceColumns& planes, const double* center, double same, double* box = nullptr);

 private:
  // `label` names the plane that made the edge from a corner to the next, -1 for the square.
  struct Polygon {
    std::vector<double> x, y;
    std::vector<Index> label;
    Index size = 0;

    void reserve(Index n);
    void push(double px, double py, Index name) {
      x[size] = px;
      y[size] = py;
      label[size++] = name;
    }
  };

  void sort_by_slack(const HalfSpaceColumns& planes, const double* center);
  void project(Index i);
  bool cut_face(Index i, double same);
  Index side_of_corners(Index j);
  void push_crossing(Index from, Index to, Index name);
  void push_corners(Index first, Index last);
  void cut_polygon(Index j, Index outside);
  void widen(Index i, double* box) const;

  Index n_ = 0;
  std::vector<Index> order_;
  std::vector<double> slack_, x_, y_, z_;  // the planes, nearest first
  // Their normals in the frame of the plane at work, and the half-planes p x + q y <= right that they are there.
  std::vector<double> alike_, p_, q_, square_, right_, right_square_;
  double frame_[2][3] = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  Polygon polygon_, next_;
  double reach_ = 0.0;  // largest squared distance of a corner from the foot of the centre
  std::vector<double> values_, shared_;
  std::uint64_t beyond_ = 0;
};

}  // namespace voxkernel
