#include "boundary_loops.h"

#include <cstdint>
#include <limits>
#include <vector>

#include "pages.h"

namespace voxkernel {
namespace {

constexpr int kNone = -1;
constexpr Index kMost32 = std::numeric_limits<std::int32_t>::max();

// The half-edges that begin, or end, at each vertex: lists, from which the last one is taken first. Most have one.
template <typename Id>
class EdgesAtVertices {
 public:
  EdgesAtVertices(Index n_vertices, Index n_edges) : last_(n_vertices, Id{kNone}), n_edges_(n_edges) {}

  void add(Index vertex, Index edge) {
    const Id before = last_[vertex];
    if (before != kNone && before_.empty()) before_.assign(n_edges_, Id{kNone});
    if (before != kNone) before_[edge] = before;
    last_[vertex] = static_cast<Id>(edge);
  }
  // `kNone` where there is none left.
  Index take(Index vertex) {
    const Id edge = last_[vertex];
    if (edge != kNone) last_[vertex] = before_.empty() ? Id{kNone} : before_[edge];
    return edge;
  }

 private:
  Brief<Id> last_;
  Brief<Id> before_;  // empty until a vertex has two
  Index n_edges_;
};

template <typename Id>
class Border {
 public:
  Border(Triangles faces, Index n_vertices, Indices border)
      : faces_(faces),
        border_(border),
        outgoing_(n_vertices, border.size()),
        incoming_(n_vertices, border.size()),
        is_used_(border.size(), 0) {
    for (Index edge = 0; edge < border.size(); ++edge) {
      outgoing_.add(tail(edge), edge);
      incoming_.add(head(edge), edge);
    }
  }

  Index size() const { return border_.size(); }
  bool is_used(Index edge) const { return is_used_[edge] != 0; }
  Index tail(Index edge) const { return faces_(border_[edge] / 3, border_[edge] % 3); }
  Index head(Index edge) const { return faces_(border_[edge] / 3, (border_[edge] + 1) % 3); }
  // Uses up a half-edge at a vertex; returns its other end, or `kNone`.
  Index step(Index vertex) {
    const Index forward = take(outgoing_, vertex);
    if (forward != kNone) return head(forward);
    const Index backward = take(incoming_, vertex);
    return backward != kNone ? tail(backward) : kNone;
  }

 private:
  Index take(EdgesAtVertices<Id>& edges, Index vertex) {
    for (Index edge = edges.take(vertex); edge != kNone; edge = edges.take(vertex)) {
      if (is_used_[edge] != 0) continue;
      is_used_[edge] = 1;
      return edge;
    }
    return kNone;
  }

  Triangles faces_;
  Indices border_;
  EdgesAtVertices<Id> outgoing_, incoming_;
  Brief<std::uint8_t> is_used_;
};

}  // namespace

bool is_small_border(Index n_vertices, Indices border) {
  // A chain of k half-edges that ends has k + 1 vertices.
  return n_vertices <= kMost32 && 2 * border.size() <= kMost32;
}

template <typename Id>
void find_boundary_loops(Triangles faces, Index n_vertices, Indices border, Loops<Id>& loops, Stop& stop) {
  Border<Id> edges(faces, n_vertices, border);
  Brief<Id> place(n_vertices, Id{kNone});  // on the path
  std::vector<Index> path;
  const auto give = [&](Index first) {
    for (Index i = first; i < static_cast<Index>(path.size()); ++i) {
      loops.vertices.push(static_cast<Id>(path[i]));
      place[path[i]] = kNone;
    }
    loops.starts.push(static_cast<Id>(loops.vertices.size()));
  };
  loops.starts.push(0);
  for (Index edge = 0; edge < edges.size(); ++edge) {
    if (edges.is_used(edge)) continue;
    path.assign(1, edges.tail(edge));
    place[path[0]] = 0;
    for (Index vertex = edges.step(path.back()); vertex != kNone; vertex = edges.step(path.back())) {
      stop.poll();
      const Index first = place[vertex];
      if (first == kNone) {
        place[vertex] = static_cast<Id>(path.size());
        path.push_back(vertex);
        continue;
      }
      give(first);  // a simple loop is closed: take it off the path, but for where it began
      path.resize(first + 1);
      place[vertex] = static_cast<Id>(first);
    }
    if (path.size() > 1) {
      give(0);
    } else {
      place[path[0]] = kNone;
    }
  }
}

template void find_boundary_loops(Triangles, Index, Indices, Loops<std::int32_t>&, Stop&);
template void find_boundary_loops(Triangles, Index, Indices, Loops<std::int64_t>&, Stop&);

}  // namespace voxkernel
