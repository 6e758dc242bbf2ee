#include "dual_insertion.h"

#include <algorithm>
#include <cmath>

#include "octahedron.h"
#include "workers.h"

namespace voxkernel {
namespace {

constexpr int kFirstShift = 14, kStep = 2;  // cells of the first round, and how much finer those of the next are
constexpr int kAloneShift = 10;             // finer rounds run on several threads
constexpr std::int32_t kFewest = 1 << 12;   // points a thread

// A point that is left to others, and where its way ended.
struct Left {
  std::int32_t point, place;
};

// One round of a stretch of points: the farthest one of every cell that is not in yet; all of them where `shift` is
// negative. Points that are left to others are listed.
void insert_round(const DualPoints& duals, std::int32_t first, std::int32_t last, int shift, Brief<char>& is_in,
                  Inserter& inserter, std::vector<Left>& left, Stop& stop) {
  const auto insert = [&](std::int32_t i) {
    if (is_in[i] != 0) return;
    is_in[i] = 1;
    if (!inserter.insert(i, stop)) left.push_back({i, inserter.place()});
  };
  for (std::int32_t i = first; i < last;) {
    stop.poll();
    if (shift < 0) {
      insert(i++);
      continue;
    }
    const std::uint32_t cell = duals.keys[i] >> shift;
    std::int32_t best = i;
    double longest = -1.0;
    for (; i < last && duals.keys[i] >> shift == cell; ++i) {
      const double* q = duals.points[i].q;
      const double length = q[0] * q[0] + q[1] * q[1] + q[2] * q[2];
      if (length > longest) {
        longest = length;
        best = i;
      }
    }
    insert(best);
  }
}

}  // namespace

Triangulation::Triangulation(const DualPoints& duals, int n_inserters)
    : triangles(static_cast<std::size_t>(2) * duals.size() + 8 + kChunk * (n_inserters + 1)),
      size(8),
      slots(duals.size() + 6, -1),
      first_same(duals.size()) {
  const std::int32_t x = duals.size();
  for (int i = 0; i < 8; ++i) {
    const std::int32_t* face = kOctahedron[i];
    triangles[i] = {{x + face[0], x + face[1], x + face[2]}, {-1, -1, -1}, 0};
  }
  link_octahedron(triangles.get());
  for (std::int32_t i = 0; i < x; ++i) first_same[i] = i;
}

Inserter::Inserter(const DualPoints& duals, const PlaneLattice& lattice, Triangulation& hull)
    : signs(duals, lattice), duals_(duals), hull_(hull) {}

void Inserter::own(std::int32_t first, std::int32_t last) {
  first_ = first;
  last_ = last;
  const auto may_begin = [&](std::int32_t place) {
    const DualTriangle& t = hull_.triangles[place];
    return t.is_there() && may_read(t);
  };
  has_begin_ = may_begin(at_);
  const std::int32_t size = hull_.size;
  for (std::int32_t i = 0; i < size && !has_begin_; ++i) {
    at_ = i;
    has_begin_ = may_begin(i);
  }
  before_ = at_;
  has_given_up_ = false;
  begins_.clear();
  if (has_begin_ && last <= duals_.size()) find_begins();
}

// A triangle at the first corner of each stretch that has one. What is own may be in pieces, to some of which no walk
// leads.
void Inserter::find_begins() {
  begins_.assign(kBegins, -1);
  for (std::int32_t i = first_; i < last_; ++i) {
    std::int32_t& begin = begins_[stretch_of(i)];
    const std::int32_t place = hull_.slots[i];
    if (begin >= 0 || place < 0) continue;
    const DualTriangle& t = hull_.triangles[place];
    if (t.is_there() && (t.corner[0] == i || t.corner[1] == i || t.corner[2] == i)) begin = place;
  }
}

void Inserter::begin_near(std::int32_t l, std::int32_t place) {
  const DualTriangle& t = hull_.triangles[place];
  if (!t.is_there() || !may_read(t)) return;
  const double* q = duals_.points[l].q;
  const auto along = [&](std::int32_t corner) {
    const double* p = duals_.points[corner].q;
    return (p[0] * q[0] + p[1] * q[1] + p[2] * q[2]) / std::sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]);
  };
  if (along(t.corner[0]) > along(hull_.triangles[at_].corner[0])) at_ = place;
}

// The triangle whose cone, closed, holds dual point l; or one that l is beyond; -1 where the way leads out of what is
// own.
std::int32_t Inserter::locate(std::int32_t l, int* where, Stop& stop) {
  std::int32_t at = at_;
  for (std::int32_t steps = 0;; ++steps) {
    stop.poll();
    const DualTriangle& t = hull_.triangles[at];
    place_ = at;
    random_ ^= random_ << 13;
    random_ ^= random_ >> 17;
    random_ ^= random_ << 5;
    const int first = static_cast<int>(random_ % 3);
    int uncertain = 0, next = -1;
    for (int j = 0; j < 3 && next < 0; ++j) {
      const int k = (first + j) % 3;
      const int sign = signs.rounded_side(t.corner[(k + 1) % 3], t.corner[(k + 2) % 3], l);
      if (sign == -1) next = k;
      if (sign == 2) uncertain |= 1 << k;
    }
    if (next < 0) {
      *where = beyond(t, l);
      if (*where > 0 || uncertain == 0) return at;
      for (int k = 0; k < 3 && next < 0; ++k) {
        if ((uncertain >> k & 1) != 0 && signs.side(t.corner[(k + 1) % 3], t.corner[(k + 2) % 3], l) < 0) next = k;
      }
      if (next < 0) return at;
    }
    if (!is_own(t.corner[(next + 1) % 3]) && !is_own(t.corner[(next + 2) % 3])) return -1;
    at = t.across[next];
    // A walk at random gets there; should it take very long, all triangles are asked.
    if (steps > 1000 + hull_.size / 2) return look_everywhere(l, where, stop);
  }
}

std::int32_t Inserter::look_everywhere(std::int32_t l, int* where, Stop& stop) {
  if (last_ <= duals_.size()) return -1;  // others are at work
  std::int32_t touched = at_;
  *where = -1;
  for (std::int32_t i = 0; i < hull_.size; ++i) {
    if (!hull_.triangles[i].is_there()) continue;
    stop.poll();
    const int found = beyond(hull_.triangles[i], l);
    if (found > *where) {
      *where = found;
      touched = i;
      if (found > 0) break;
    }
  }
  return touched;
}

std::int32_t Inserter::new_place() {
  if (!free_.empty()) {
    const std::int32_t place = free_.back();
    free_.pop_back();
    return place;
  }
  if (chunk_ == chunk_end_) {
    chunk_ = hull_.size.fetch_add(Triangulation::kChunk);
    chunk_end_ = chunk_ + Triangulation::kChunk;
    for (std::int32_t i = chunk_; i < chunk_end_; ++i) hull_.triangles[i].corner[0] = -1;
  }
  return chunk_++;
}

// What is own may be in pieces: the next walk begins where this one's piece was entered from.
bool Inserter::give_up() {
  const DualTriangle& t = hull_.triangles[before_];
  if (t.is_there() && may_read(t)) at_ = before_;
  has_given_up_ = true;
  return false;
}

bool Inserter::insert(std::int32_t l, Stop& stop) {
  stop.poll(16);
  if (!has_begin_) return false;
  DualTriangle* triangles = hull_.triangles.get();
  if (has_given_up_ && !begins_.empty() && begins_[stretch_of(l)] >= 0) begin_near(l, begins_[stretch_of(l)]);
  has_given_up_ = false;
  int where;
  const std::int32_t at = locate(l, &where, stop);
  if (at < 0 || (where >= 0 && !owns(triangles[at]))) return give_up();
  if (where <= 0) {
    at_ = at;
    if (where == 0) note_same(triangles[at], l);
    return true;
  }
  // What it sees, by neighbours.
  ++stamp;
  seen_.clear();
  seen_.push_back(at);
  triangles[at].mark = stamp;
  horizon_.clear();
  for (std::size_t i = 0; i < seen_.size(); ++i) {
    for (const std::int32_t other : triangles[seen_[i]].across) {
      DualTriangle& o = triangles[other];
      if (!owns(o)) return give_up();
      if (o.mark == stamp) continue;
      if (o.mark != -stamp && beyond(o, l) > 0) {
        o.mark = stamp;
        seen_.push_back(other);
      } else {
        o.mark = -stamp;
      }
    }
  }
  stop.poll(4 * static_cast<Index>(seen_.size()));
  for (const std::int32_t current : seen_) {
    const DualTriangle& t = triangles[current];
    for (int k = 0; k < 3; ++k) {
      if (triangles[t.across[k]].mark == stamp) continue;
      int back = 0;
      while (triangles[t.across[k]].across[back] != current) ++back;
      horizon_.push_back({t.corner[(k + 1) % 3], t.corner[(k + 2) % 3], t.across[k], back});
    }
  }
  // New triangles, from each edge of the horizon to the point, in the places of those that go.
  fresh_.clear();
  for (const Edge& edge : horizon_) {
    std::int32_t place;
    if (seen_.empty()) {
      place = new_place();
    } else {
      place = seen_.back();
      seen_.pop_back();
    }
    triangles[place] = {{edge.from, edge.to, l}, {-1, -1, edge.outside}, 0};
    triangles[edge.outside].across[edge.back] = place;
    hull_.slots[edge.from] = place;
    fresh_.push_back(place);
  }
  for (const std::int32_t gone : seen_) {
    triangles[gone].corner[0] = -1;
    free_.push_back(gone);
  }
  for (std::size_t i = 0; i < horizon_.size(); ++i) {
    const std::int32_t next = hull_.slots[horizon_[i].to];
    triangles[fresh_[i]].across[0] = next;
    triangles[next].across[1] = fresh_[i];
  }
  before_ = at_;
  at_ = fresh_[0];
  return true;
}

// A point on a triangle may be one of its corners: two half-spaces that are the same.
void Inserter::note_same(const DualTriangle& t, std::int32_t l) {
  for (const std::int32_t other : t.corner) {
    if (other >= duals_.size()) continue;
    const DualPoint &a = duals_.points[other], &b = duals_.points[l];
    bool is_near = true;
    for (int k = 0; k < 3; ++k) is_near = is_near && std::abs(a.q[k] - b.q[k]) <= 2.0 * (a.error + b.error);
    if (is_near && signs.exact.are_same(other, l)) {
      std::int32_t& first = hull_.first_same[other];
      if (duals_.rows[l] < duals_.rows[first]) first = l;
      return;
    }
  }
}

// Rounds: the farthest point of every cell, of coarse cells first; the rest in the last one. Inserters on several
// threads have a stretch of directions each; what crosses the border between two is done after the round.
void insert_all(DualPoints& duals, std::vector<Inserter>& inserters, Stop& stop) {
  const std::int32_t n = duals.size(), everything = n + 6;
  Inserter& main = inserters.front();
  main.own(0, everything);
  if (duals.keys.empty()) {
    for (std::int32_t i = 0; i < n; ++i) main.insert(i, stop);
    return;
  }
  const int n_parts = std::max(1, std::min(static_cast<int>(inserters.size()), n / kFewest));
  Brief<char> is_in(n, 0);
  std::vector<std::vector<Left>> left(n_parts);
  for (int shift = kFirstShift; shift >= -kStep; shift -= kStep) {
    const int parts = shift > kAloneShift ? 1 : n_parts;
    const auto begin = [&](int part) { return static_cast<std::int32_t>(part_begin(n, parts, part)); };
    for (int part = 0; parts > 1 && part < parts; ++part) {
      inserters[part].own(begin(part), begin(part + 1));
      inserters[part].stamp = main.stamp;
    }
    run_parts(parts, stop, [&](int part, Stop& own) {
      insert_round(duals, begin(part), begin(part + 1), shift, is_in, inserters[part], left[part], own);
    });
    for (const Inserter& inserter : inserters) main.stamp = std::max(main.stamp, inserter.stamp);
    main.own(0, everything);
    for (std::vector<Left>& points : left) {
      for (const Left& one : points) {
        main.begin_near(one.point, one.place);
        main.insert(one.point, stop);
      }
      points.clear();
    }
  }
  Brief<std::uint32_t>().swap(duals.keys);
}

}  // namespace voxkernel
