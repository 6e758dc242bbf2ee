#include "cell_sides.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "cell_planes.h"

namespace voxkernel {
namespace {

enum Answer : Index { kApart = -3, kOneSided = -2, kNoSurface = -1, kInDoubt = 0, kDone = 1 };

// An edge of a face: both its vertices in one number, and 2 f + 1 where face f traverses it upward, 2 f downward.
struct Use {
  Index edge, use;
};

// Smallest edge first. The order of equal edges decides which of two faces is turned, so it stays as it always was:
// insertion for few, a heap for many.
void sink(Use* heap, Index root, Index n, Use item) {
  for (Index child = 2 * root + 1; child < n; child = 2 * root + 1) {
    if (child + 1 < n && heap[child + 1].edge > heap[child].edge) ++child;
    if (heap[child].edge <= item.edge) break;
    heap[root] = heap[child];
    root = child;
  }
  heap[root] = item;
}
void sort(Use* uses, Index n) {
  if (n <= 32) {
    for (Index j = 1; j < n; ++j) {
      const Use item = uses[j];
      Index p = j;
      for (; p > 0 && uses[p - 1].edge > item.edge; --p) uses[p] = uses[p - 1];
      uses[p] = item;
    }
    return;
  }
  for (Index root = n / 2 - 1; root >= 0; --root) sink(uses, root, n, uses[root]);
  for (Index end = n - 1; end > 0; --end) {
    const Use item = uses[end];
    uses[end] = uses[0];
    sink(uses, 0, end, item);
  }
}

class Orienter {
 public:
  Orienter(const CellMesh& mesh, CellSizes largest)
      : mesh_(mesh), cell_(mesh, largest), uses_(largest.corners), parent_(largest.faces), turned_(largest.faces) {}

  Answer orient(Index cell, Span<bool> flips, Stop& stop);

 private:
  Index list_uses();
  Answer join_faces(Index n_uses);
  void turn_faces(Span<bool> flips);
  Bounded enclosed_volume();

  struct Root {
    Index face;
    bool is_turned;  // whether the face that was asked for is turned against it
  };
  Root root(Index f) const {
    bool turn = false;
    for (; parent_[f] != f; f = parent_[f]) turn ^= turned_[f] != 0;
    return {f, turn};
  }

  const CellMesh& mesh_;
  Cell cell_;
  std::vector<Use> uses_;
  std::vector<Index> parent_;
  std::vector<char> turned_;
};

Index Orienter::list_uses() {
  Index n = 0;
  for (Index f = 0; f < cell_.n_faces; ++f) {
    parent_[f] = f;
    turned_[f] = 0;
    Index a = cell_.ring[cell_.start[f + 1] - 1];
    for (Index j = cell_.start[f]; j < cell_.start[f + 1]; ++j) {
      const Index b = cell_.ring[j];
      if (a != b) uses_[n++] = {std::min(a, b) * cell_.n_vertices + std::max(a, b), 2 * f + (a < b ? 1 : 0)};
      a = b;
    }
  }
  sort(uses_.data(), n);
  return n;
}

// Joins the two faces of every edge, turned so that they traverse it in opposite directions.
Answer Orienter::join_faces(Index n) {
  if (n % 2 != 0) return kNoSurface;
  for (Index j = 0; j < n; j += 2) {
    const Use one = uses_[j], two = uses_[j + 1];
    if (one.edge != two.edge || (j + 2 < n && uses_[j + 2].edge == one.edge)) return kNoSurface;
    const Root f = root(one.use >> 1), g = root(two.use >> 1);
    const bool turn = f.is_turned ^ g.is_turned ^ ((one.use & 1) == (two.use & 1));
    if (f.face != g.face) {
      parent_[g.face] = f.face;
      turned_[g.face] = turn ? 1 : 0;
    } else if (turn) {
      return kOneSided;
    }
  }
  const Index top = root(0).face;
  for (Index f = 1; f < cell_.n_faces; ++f) {
    if (root(f).face != top) return kApart;
  }
  return kDone;
}

void Orienter::turn_faces(Span<bool> flips) {
  for (Index f = 0; f < cell_.n_faces; ++f) {
    if (!root(f).is_turned) continue;
    flips[f] = !flips[f];
    std::reverse(cell_.ring.begin() + cell_.start[f], cell_.ring.begin() + cell_.start[f + 1]);
  }
}

// Nothing is certain of a cell that has no frame.
Bounded Orienter::enclosed_volume() {
  const Frame frame = local_frame(cell_.points());
  if (frame.scale <= 0.0) return {0.0, 0.0};
  for (Index v = 0; v < 3 * cell_.n_vertices; ++v) cell_.raw[v] = (cell_.raw[v] - frame.origin[v % 3]) / frame.scale;
  return fan_volume(cell_.points(), cell_.polygons());
}

Answer Orienter::orient(Index cell, Span<bool> flips, Stop& stop) {
  stop.poll(100);
  if (!cell_.gather(mesh_, flips, cell)) return kNoSurface;
  const Index n_uses = list_uses();
  stop.poll(20 * n_uses);
  const Answer answer = join_faces(n_uses);
  if (answer != kDone) return answer;
  const Span<bool> own = flips.part(mesh_.cell_offsets[cell], mesh_.cell_offsets[cell + 1]);
  turn_faces(own);
  const auto [volume, doubt] = enclosed_volume();
  if (std::abs(volume) <= doubt) return kInDoubt;
  if (volume < 0.0) {
    for (bool& flip : own) flip = !flip;
  }
  return kDone;
}

}  // namespace

void orient_cells(const CellMesh& mesh, Span<bool> flips, Span<Index> answer, Stop& stop) {
  const Index n = mesh.cell_offsets.size() - 1;
  Orienter orienter(mesh, largest_sizes(mesh, 0, n));
  for (Index cell = 0; cell < n; ++cell) answer[cell] = orienter.orient(cell, flips, stop);
}

}  // namespace voxkernel
