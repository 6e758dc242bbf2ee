// A deep point of half-spaces, or a few of them that seem to have none in common, found on a growing working set.
#pragma once

#include "deepest_point.h"
#include "spans.h"
#include "stop.h"

namespace voxkernel {

// What floating point has to say. `rows` is the working set at the end. A point with a depth above zero is proven to
// lie inside all half-spaces; `opposing` is a claim that is still to be proven.
struct DeepPoint {
  std::vector<Index> rows;
  std::vector<Index> opposing;  // half-spaces without a common point; empty where none were found
  double gap = 0.0;             // by how much they miss
  double depth = 0.0;           // smallest slack at `point`; 0 where no point is proven
  double point[3] = {0.0, 0.0, 0.0};
  std::vector<Index> nearest;  // where nothing is proven: the members of the working set nearest to the last point
  Index passes = 0;
};

// The deepest point of a working set is an upper bound of the depth. Planes that are tighter at it join the set, the
// tightest of each direction, until a point is proven deep enough, the set has no common point, or nothing is new.
// One step at a time, for callers that go over all half-spaces in their own way:
//     add(the first); while (propose()) { look at all half-spaces at point(); if (!judge(...)) break; add(fresh); }
class DeepPointSearch {
 public:
  // All of few half-spaces, an even sample of many.
  static std::vector<Index> first_rows(Index n);

  // Takes half-spaces into the working set: their numbers, and their planes.
  void add(Indices rows, Points normals, Doubles offsets);
  // Whether there is a point to be looked at.
  bool propose(Stop& stop);
  const double* point() const { return deepest_.point.data(); }
  // Half-spaces with a slack of less are tighter than the working set.
  double upper() const { return deepest_.point[3]; }
  // Of half-spaces that are tighter, those that are new, ascending; -1 is none.
  std::vector<Index> fresh(Indices ids) const;
  // Hears the smallest slack at the point, the smallest one less its error bound, and whether any half-space is new;
  // whether to go on.
  bool judge(double smallest, double certain, bool is_any_new);
  DeepPoint result() const;

 private:
  bool leans_on_box() const;
  std::vector<Index> nearest_rows() const;

  HalfSpaceColumns planes_{0};  // those of the working set, without errors: the simplex asks for none
  DeepestPoint deepest_;
  DeepPoint found_;
  int round_ = 0, box_ = 0;
};

// The same for any number of threads.
DeepPoint find_deep_point(Points normals, Doubles offsets, Doubles errors, int threads, Stop& stop);

}  // namespace voxkernel
