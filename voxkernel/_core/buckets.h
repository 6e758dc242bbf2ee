// Entries bucketed by vertex, in linear time: those of one vertex lie together.
#pragma once

#include <utility>

#include "pages.h"
#include "spans.h"
#include "stop.h"

namespace voxkernel {

// `Small` holds vertices and the number of entries.
template <typename Small, typename Entry>
class Buckets {
 public:
  // `each(put)` calls `put(vertex, make)` for every entry, which is what `make()` returns. It is run twice: entries are
  // counted, then stored.
  template <typename Each>
  Buckets(Index n_vertices, Each&& each) : end_(counted(n_vertices, each)), entries_(size()) {
    // Filling moves each start to where the next one was.
    each([&](Index vertex, auto&& make) { entries_[static_cast<Index>(end_[vertex]++)] = make(); });
  }

  // Calls `visit(first, n)` for the entries of every vertex that has any; it may order them.
  template <typename Visit>
  void for_each_bucket(Stop& stop, Visit&& visit) {
    Index first = 0;
    for (Index vertex = 0; vertex + 1 < static_cast<Index>(end_.size()); ++vertex) {
      const auto last = static_cast<Index>(end_[vertex]);
      stop.poll(1 + last - first);
      if (last > first) visit(entries_.get() + first, last - first);
      first = last;
    }
  }

 private:
  template <typename Each>
  static Brief<Small> counted(Index n_vertices, Each&& each) {
    Brief<Small> end(n_vertices + 1, 0);
    each([&](Index vertex, auto&& /*make*/) { ++end[vertex + 1]; });
    for (Index vertex = 0; vertex < n_vertices; ++vertex) end[vertex + 1] += end[vertex];
    return end;
  }
  std::size_t size() const { return static_cast<std::size_t>(end_.back()); }

  Brief<Small> end_;
  BriefArray<Entry> entries_;
};

}  // namespace voxkernel
