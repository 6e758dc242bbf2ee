// Loops over many small steps that poll between stretches: one poll a step would cost a tenth of the time.
#pragma once

#include <algorithm>

#include "spans.h"
#include "stop.h"

namespace voxkernel {

// Calls `visit(i)` for every i below n; `work` is that of one step (see `Stop::poll`).
template <typename Visit>
void for_each(Index n, Index work, Stop& stop, Visit&& visit) {
  constexpr Index kStretch = 1 << 10;
  for (Index first = 0; first < n; first += kStretch) {
    const Index last = std::min(n, first + kStretch);
    for (Index i = first; i < last; ++i) visit(i);
    stop.poll((last - first) * work);
  }
}

}  // namespace voxkernel
