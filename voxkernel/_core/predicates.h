// On which side of a triangle a point lies, decided exactly.
#pragma once

namespace voxkernel {

// Both are exact while every coordinate is 0 or of magnitude 2**-300 .. 2**300; their caller looks at that once for
// the whole mesh. See predicates.cpp.

// Sign (-1, 0 or 1) of the determinant of (a - d, b - d, c - d): positive below the triangle, from where it is
// clockwise.
double orient3d_exact(const double* a, const double* b, const double* c, const double* d);

// A number of the sign of ((b - a) x (c - a)) . (d - a): positive above the triangle; filtered, then in integers of
// fixed width where the coordinates lie on one lattice of few bits, and else by the expansions of the above.
double orientation(const double* a, const double* b, const double* c, const double* d);

}  // namespace voxkernel
