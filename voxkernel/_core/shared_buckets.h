// Entries bucketed by vertex on several threads, in linear time: those of one vertex lie together, in the order in
// which one thread would find them.
#pragma once

#include <algorithm>
#include <vector>

#include "pages.h"
#include "spans.h"
#include "workers.h"

namespace voxkernel {

// `Small` holds vertices and the number of entries.
template <typename Small, typename Entry>
class SharedBuckets {
 public:
  // `each(first, last, stop, put)` calls `put(vertex, make)` for the entries of the items first .. last; an entry is
  // what `make()` returns. It is run twice on each stretch of items: entries are counted, then stored.
  template <typename Each>
  SharedBuckets(Index n_vertices, Index n_items, Index least, int threads, Stop& stop, Each&& each)
      : n_parts_(worth_threads(n_items, least, std::min(threads, kMostParts))),
        ends_(counted(n_vertices, n_items, stop, each)),
        entries_(static_cast<std::size_t>(size_)) {
    run_parts(n_parts_, stop, [&](int part, Stop& own) {
      // Filling moves each start to where those of the next part, or of the next vertex, begin.
      Brief<Small>& next = ends_[part];
      each(part_begin(n_items, n_parts_, part), part_begin(n_items, n_parts_, part + 1), own,
           [&](Index vertex, auto&& make) { entries_[static_cast<Index>(next[vertex]++)] = make(); });
    });
  }

  // Calls `visit(first, n)` for the entries of every vertex that has any, until one returns false; it may order them.
  template <typename Visit>
  void for_each_bucket(Stop& stop, Visit&& visit) {
    const Brief<Small>& ends = ends_.back();
    // As many entries for each thread.
    const auto begin = [&](int part) {
      const auto least = static_cast<Small>(part_begin(size_, n_parts_, part));
      return part == 0 ? Index{0}
                       : static_cast<Index>(std::lower_bound(ends.begin(), ends.end(), least) - ends.begin());
    };
    run_parts(n_parts_, stop, [&](int part, Stop& own) {
      const Index end = part + 1 == n_parts_ ? static_cast<Index>(ends.size()) : begin(part + 1);
      Index vertex = begin(part);
      Index first = vertex == 0 ? 0 : static_cast<Index>(ends[vertex - 1]);
      for (; vertex < end; ++vertex) {
        const auto last = static_cast<Index>(ends[vertex]);
        own.poll(1 + last - first);
        if (last > first && !visit(entries_.get() + first, last - first)) return;
        first = last;
      }
    });
  }

 private:
  static constexpr int kMostParts = 8;  // each counts the entries of every vertex

  // Where the entries of each vertex begin that are those of a part.
  template <typename Each>
  std::vector<Brief<Small>> counted(Index n_vertices, Index n_items, Stop& stop, Each&& each) {
    std::vector<Brief<Small>> begins(n_parts_);
    run_parts(n_parts_, stop, [&](int part, Stop& own) {
      Brief<Small>& count = begins[part];
      count.assign(n_vertices, 0);
      each(part_begin(n_items, n_parts_, part), part_begin(n_items, n_parts_, part + 1), own,
           [&](Index vertex, auto&& /*make*/) { ++count[vertex]; });
    });
    Small sum = 0;
    for (Index vertex = 0; vertex < n_vertices; ++vertex) {
      for (Brief<Small>& part : begins) {
        const Small count = part[vertex];
        part[vertex] = sum;
        sum += count;
      }
    }
    size_ = static_cast<Index>(sum);
    return begins;
  }

  int n_parts_;
  Index size_ = 0;
  std::vector<Brief<Small>> ends_;  // of each part
  BriefArray<Entry> entries_;
};

}  // namespace voxkernel
