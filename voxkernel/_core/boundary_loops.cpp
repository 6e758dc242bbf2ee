#include "boundary_loops.h"

#include <cstdint>

#include "pages.h"

namespace voxkernel {
namespace {

constexpr Index kNone = -1;

// The half-edges that begin, or end, at each vertex: lists, from which the last one is taken first.
class EdgesAtVertices {
 public:
  EdgesAtVertices(Index n_vertices, Index n_edges) : last_(n_vertices, kNone), before_(n_edges) {}

  void add(Index vertex, Index edge) {
    before_[edge] = last_[vertex];
    last_[vertex] = edge;
  }
  // `kNone` where there is none left.
  Index take(Index vertex) {
    const Index edge = last_[vertex];
    if (edge != kNone) last_[vertex] = before_[edge];
    return edge;
  }

 private:
  Brief<Index> last_;
  Brief<Index> before_;
};

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
  Index take(EdgesAtVertices& edges, Index vertex) {
    for (Index edge = edges.take(vertex); edge != kNone; edge = edges.take(vertex)) {
      if (is_used_[edge] != 0) continue;
      is_used_[edge] = 1;
      return edge;
    }
    return kNone;
  }

  Triangles faces_;
  Indices border_;
  EdgesAtVertices outgoing_, incoming_;
  Brief<std::uint8_t> is_used_;
};

}  // namespace

Loops boundary_loops(Triangles faces, Index n_vertices, Indices border, Stop& stop) {
  Border edges(faces, n_vertices, border);
  Brief<Index> place(n_vertices, kNone);  // on the path
  std::vector<Index> path;
  Loops loops;
  const auto give = [&](Index first) {
    for (Index i = first; i < static_cast<Index>(path.size()); ++i) {
      loops.vertices.push_back(path[i]);
      place[path[i]] = kNone;
    }
    loops.starts.push_back(static_cast<Index>(loops.vertices.size()));
  };
  loops.starts.push_back(0);
  for (Index edge = 0; edge < edges.size(); ++edge) {
    if (edges.is_used(edge)) continue;
    path.assign(1, edges.tail(edge));
    place[path[0]] = 0;
    for (Index vertex = edges.step(path.back()); vertex != kNone; vertex = edges.step(path.back())) {
      stop.poll();
      const Index first = place[vertex];
      if (first == kNone) {
        place[vertex] = static_cast<Index>(path.size());
        path.push_back(vertex);
        continue;
      }
      give(first);  // a simple loop is closed: take it off the path, but for where it began
      path.resize(first + 1);
      place[vertex] = first;
    }
    if (path.size() > 1) {
      give(0);
    } else {
      place[path[0]] = kNone;
    }
  }
  return loops;
}

}  // namespace voxkernel
