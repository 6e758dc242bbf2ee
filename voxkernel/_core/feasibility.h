// A deep point of half-spaces, or a few of them that seem to have none in common, found on a growing working set.
#pragma once

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

DeepPoint find_deep_point(Points normals, Doubles offsets, Doubles errors, Stop& stop);

}  // namespace voxkernel
