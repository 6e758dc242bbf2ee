// Where segments are probed before they are walked along, and how far off.
#pragma once

#include "spans.h"

namespace voxkernel {

constexpr int kProbes[4] = {0, 7, 15, 31};  // before each stage, and all
constexpr int kAllProbes = kProbes[3];
constexpr Index kNear[3] = {0, 8, 16};  // nearer along all axes a stage would find almost nothing

// Where the probes are along a segment, in parts of 64, in two orders: each next one finds most of what those before it
// miss of what is hidden on some families of bodies. Little is hidden from the middle of bodies that are nearly stars,
// and mostly just before the target.
constexpr int kOrders = 2;
constexpr Index kParts = 64;
constexpr Index kShares[kOrders][kAllProbes] = {
    {8,  16, 24, 32, 40, 48, 56, 33, 60, 50, 42, 20, 28, 58, 37, 61,
     53, 57, 45, 35, 26, 10, 17, 38, 29, 59, 13, 5,  41, 36, 44},
    {36, 59, 53, 25, 61, 57, 45, 60, 16, 56, 31, 58, 20, 40, 49, 62,
     8,  33, 42, 10, 23, 28, 48, 5,  17, 54, 12, 51, 37, 4,  41},
};
// A segment by d >= 0 voxels along an axis is, just before the share of probe p, so many voxels from its start:
// ceil(share d / 64 - 1/2).
constexpr Index probe_at(int order, int p, Index d) { return (kShares[order][p] * d + kParts / 2 - 1) / kParts; }
// Probes of all stages at places that are so far along an axis.
constexpr int n_probes(Index far) { return far < kNear[1] ? kProbes[1] : far < kNear[2] ? kProbes[2] : kProbes[3]; }

}  // namespace voxkernel
