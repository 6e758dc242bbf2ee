// The parts of a graph, joined link by link.
#pragma once

#include <utility>
#include <vector>

#include "pages.h"
#include "spans.h"

namespace voxkernel {

template <typename Small>
class UnionFind {
 public:
  explicit UnionFind(Index n) : parents_(n), n_parts_(n) {
    for (Index i = 0; i < n; ++i) parents_[i] = static_cast<Small>(i);
  }

  void join(Index one, Index two) {
    Small a = root(static_cast<Small>(one)), b = root(static_cast<Small>(two));
    if (a == b) return;
    if (a > b) std::swap(a, b);
    parents_[b] = a;
    --n_parts_;
  }
  Index n_parts() const { return n_parts_; }
  // The part of every node for which `has_part(i)`, -1 of the others, which must be alone; parts are numbered in the
  // order of their first nodes.
  template <typename HasPart>
  std::vector<Index> labels(HasPart&& has_part) const {
    std::vector<Index> found(parents_.size());
    Index n = 0;
    for (std::size_t i = 0; i < found.size(); ++i) {
      const auto parent = static_cast<std::size_t>(parents_[i]);  // never behind its children
      if (parent != i) {
        found[i] = found[parent];
      } else {
        found[i] = has_part(static_cast<Index>(i)) ? n++ : -1;
      }
    }
    return found;
  }

 private:
  Small root(Small i) {
    while (parents_[i] != i) {
      parents_[i] = parents_[parents_[i]];
      i = parents_[i];
    }
    return i;
  }

  Brief<Small> parents_;
  Index n_parts_;
};

}  // namespace voxkernel
