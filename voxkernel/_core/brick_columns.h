// A plane in a brick of 8^3 voxels. Along a column (x, y) of voxels it is crossed between two limits of z, which are
// linear in x and y; z = 0 is the centre of the lowest voxel. The roundings, and the tilt of a plane that is nearly
// parallel to the columns: plane_bounds.h, 2.
#pragma once

#include <cmath>

#include "plane_list.h"

namespace voxkernel {

// The change of the value of a plane from voxel to voxel, and its value at voxel (0, 0, 0).
struct VoxelSteps {
  double x, y, z;

  // `half` is half the edge of a voxel.
  VoxelSteps(const PlaneView& p, Index t, double half)
      : x(2.0 * half * p.x[t]), y(2.0 * half * p.y[t]), z(2.0 * half * p.z[t]) {}
  double corner(double value) const { return value - 3.5 * (x + y + z); }
};

// What is added to r, over half the edge of a voxel, for the rounding of the limits.
constexpr double kLimitRounding = 1e-13;

struct ColumnLimits {
  double low, high;  // where the value is -r, r, along z, in the column (0, 0)
  double step_x, step_y;
  bool is_up;  // the value grows with z

  // `r` is half the edge of a voxel times the reach of plane t, with its pad and the rounding of the limits.
  ColumnLimits(const PlaneView& p, Index t, double half, double r) {
    VoxelSteps step(p, t, half);
    if (std::abs(step.z) < 2e-9 * half) {
      step.z = step.z >= 0 ? 2e-9 * half : -2e-9 * half;
      r += 1.6e-8 * half;
    }
    const double corner = step.corner(p.value[t]);
    const double inverse = 1.0 / step.z;
    low = (-r - corner) * inverse;
    high = (r - corner) * inverse;
    step_x = -step.x * inverse;
    step_y = -step.y * inverse;
    is_up = step.z > 0;
  }
};

}  // namespace voxkernel
