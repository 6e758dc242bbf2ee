// Where segments are probed before they are walked along, and how far off.
#pragma once

#include "spans.h"

namespace voxkernel {

constexpr int kProbes[4] = {0, 7, 15, 31};  // before each stage, and all
constexpr int kAllProbes = kProbes[3];
constexpr Index kNear[3] = {0, 8, 16};  // nearer along all axes a stage would find almost nothing

// Where probe p is along a segment, in parts of 32: eighths, then the sixteenths between them, then the rest.
constexpr Index share_of(int p) {
  return p < kProbes[1] ? 4 * p + 4 : p < kProbes[2] ? 4 * (p - kProbes[1]) + 2 : 2 * (p - kProbes[2]) + 1;
}
// A segment by d >= 0 voxels along an axis is, just before that share of it, so many voxels from its start:
// ceil(share d / 32 - 1/2).
constexpr Index probe_at(int p, Index d) { return (share_of(p) * d + 15) / 32; }
// Probes of all stages at places that are so far along an axis.
constexpr int n_probes(Index far) { return far < kNear[1] ? kProbes[1] : far < kNear[2] ? kProbes[2] : kProbes[3]; }

}  // namespace voxkernel
