// How many facets have the corners of an earlier one.
#pragma once

#include "spans.h"
#include "stop.h"

namespace voxkernel {

// `facet_ids` ascend; triangles of one id are one facet. A facet of several triangles is the set of their vertices, and
// never equals one of a single triangle. `is_wide`: numbers of 64 bits also where 32 would do.
Index duplicate_facets(Triangles faces, Indices facet_ids, Index n_vertices, bool is_wide, Stop& stop);

}  // namespace voxkernel
