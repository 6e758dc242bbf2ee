// Sets as rows of bits: which of many covers the most of what is left, and whether few of them can cover enough.
#pragma once

#include <cstdint>
#include <vector>

#include "spans.h"
#include "stop.h"

namespace voxkernel {

// The number of bits of each row of `sets` (n_words words each) that are in `left`.
void cover_gains(Span<const std::uint64_t> sets, Index n_words, Span<const std::uint64_t> left, Span<Index> gains,
                 Stop& stop);
// Rows of sets that are within no other one, the largest first; of equal ones the first.
std::vector<Index> maximal_sets(Span<const std::uint64_t> sets, Index n_words, Stop& stop);
// Whether `count` of the sets together hold at least `need` bits: their rows, none where no such choice exists, and
// { -1 } where that is open after `max_steps`.
std::vector<Index> find_cover(Span<const std::uint64_t> sets, Index n_words, Index count, Index need, Index max_steps,
                              Stop& stop);

}  // namespace voxkernel
