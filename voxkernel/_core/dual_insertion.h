// The convex hull of dual points as triangles, one point after the other, in spatially sorted rounds.
//
// Dual points in the plane of a triangle are not beyond it, so that a point beyond the hull sees a disk, whatever is
// degenerate; planes that touch the polytope in a vertex or an edge only are corners of triangles all of which lie in
// one or two planes.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <vector>

#include "dual_points.h"
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
  std::unique_ptr<DualTriangle[]> triangles;      // no memory before it is used
  std::atomic<std::int32_t> size;
  std::vector<std::int32_t> slots;       // of a point: on the horizon, the triangle that begins there
  std::vector<std::int32_t> first_same;  // of a point: where the first of the rows is that are the same half-space
};

// Inserts points in a stretch of places that is its own, and changes only triangles all of whose corners are: those
// are never next to those of another, so no two inserters touch the same.
class Inserter {
 public:
  Inserter(const DualPoints& duals, const PlaneSource& source, int cube_exponent, Triangulation& hull);

  // Also the sides of the cube are own where `last` is beyond them. False where there is no triangle to begin at.
  bool own(std::int32_t first, std::int32_t last);
  // False, and nothing is changed, where others own what would have to go.
  bool insert(std::int32_t l, Stop& stop);

  DualSigns signs;
  std::int32_t stamp = 0;  // no mark is larger

 private:
  struct Edge {
    std::int32_t from, to, outside;
    int back;
  };
  bool owns(const DualTriangle& t) const {
    return t.corner[0] >= first_ && t.corner[1] >= first_ && t.corner[2] >= first_ && t.corner[0] < last_ &&
           t.corner[1] < last_ && t.corner[2] < last_;
  }
  int beyond(const DualTriangle& t, std::int32_t l) { return signs.beyond(t.corner[0], t.corner[1], t.corner[2], l); }
  std::int32_t locate(std::int32_t l, int* where, Stop& stop);
  std::int32_t look_everywhere(std::int32_t l, int* where, Stop& stop);
  void note_same(const DualTriangle& t, std::int32_t l);
  std::int32_t new_place();

  const DualPoints& duals_;
  Triangulation& hull_;
  std::int32_t first_ = 0, last_ = 0;
  std::int32_t at_ = 0;  // where the last walk ended
  std::int32_t chunk_ = 0, chunk_end_ = 0;
  std::uint32_t random_ = 12345;
  std::vector<std::int32_t> free_, seen_, fresh_;
  std::vector<Edge> horizon_;
};

// Inserts all points. `inserters` has one for each thread.
void insert_all(DualPoints& duals, std::vector<Inserter>& inserters, Stop& stop);

}  // namespace voxkernel
