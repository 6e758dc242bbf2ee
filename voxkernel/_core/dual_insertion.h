// The convex hull of dual points as triangles, one point after the other, in spatially sorted rounds.
//
// Dual points in the plane of a triangle are not beyond it, so that a point beyond the hull sees a disk, whatever is
// degenerate; planes that touch the polytope in a vertex or an edge only are corners of triangles all of which lie in
// one or two planes.
#pragma once

#include <atomic>
#include <cstdint>
#include <vector>

#include "dual_points.h"
#include "pages.h"
#include "stop.h"

namespace voxkernel {

struct DualTriangle {
  std::int32_t corner[3];  // the first is -1 where there is none
  std::int32_t across[3];  // the triangle across the edge opposite corner k; its corners k + 1 and k + 2
  std::int32_t mark;

  bool is_there() const { return corner[0] >= 0; }
};

// What inserters on several threads share.
struct Triangulation {
  // The dual points of the sides of the cube: an octahedron about the centre.
  Triangulation(const DualPoints& duals, int n_inserters);

  static constexpr std::int32_t kChunk = 64;  // an inserter takes so many places at a time
  BriefArray<DualTriangle> triangles;
  std::atomic<std::int32_t> size;
  Brief<std::int32_t> slots;       // of a point: on the horizon, the triangle that begins there
  Brief<std::int32_t> first_same;  // of a point: where the first of the rows is that are the same half-space
};

// Inserts points in a stretch of places that is its own. It changes only triangles all of whose corners are, and reads
// only those that have one such corner: so it never sees what another changes, and triangles with corners of several
// stay as they are while they work.
class Inserter {
 public:
  Inserter(const DualPoints& duals, const PlaneLattice& lattice, Triangulation& hull);

  // Also the sides of the cube are own where `last` is beyond them.
  void own(std::int32_t first, std::int32_t last);
  // False, and nothing is changed, where others own what would have to go.
  bool insert(std::int32_t l, Stop& stop);
  // Where the last walk ended.
  std::int32_t place() const { return place_; }
  // The next walk, to point l, begins at a triangle if that is still there and nearer than where it would.
  void begin_near(std::int32_t l, std::int32_t place);

  DualSigns signs;
  std::int32_t stamp = 0;  // no mark is larger

 private:
  static constexpr Index kBegins = 64;
  struct Edge {
    std::int32_t from, to, outside;
    int back;
  };
  bool is_own(std::int32_t corner) const { return corner >= first_ && corner < last_; }
  bool owns(const DualTriangle& t) const { return is_own(t.corner[0]) && is_own(t.corner[1]) && is_own(t.corner[2]); }
  bool may_read(const DualTriangle& t) const {
    return is_own(t.corner[0]) || is_own(t.corner[1]) || is_own(t.corner[2]);
  }
  int beyond(const DualTriangle& t, std::int32_t l) { return signs.beyond(t.corner[0], t.corner[1], t.corner[2], l); }
  std::int32_t locate(std::int32_t l, int* where, Stop& stop);
  std::int32_t look_everywhere(std::int32_t l, int* where, Stop& stop);
  bool give_up();
  void find_begins();
  std::size_t stretch_of(std::int32_t l) const {
    return static_cast<std::size_t>(kBegins * Index{l - first_} / (last_ - first_));
  }
  void note_same(const DualTriangle& t, std::int32_t l);
  std::int32_t new_place();

  const DualPoints& duals_;
  Triangulation& hull_;
  std::int32_t first_ = 0, last_ = 0;
  bool has_begin_ = false;
  std::int32_t at_ = 0;      // where the next walk begins
  std::int32_t before_ = 0;  // where one began from which another was found
  bool has_given_up_ = false;
  std::vector<std::int32_t> begins_;  // triangles near the points of stretches of what is own; -1 where none is known
  std::int32_t place_ = 0;
  std::int32_t chunk_ = 0, chunk_end_ = 0;
  std::uint32_t random_ = 12345;
  std::vector<std::int32_t> free_, seen_, fresh_;
  std::vector<Edge> horizon_;
};

// Inserts all points. `inserters` has one for each thread.
void insert_all(DualPoints& duals, std::vector<Inserter>& inserters, Stop& stop);

}  // namespace voxkernel
