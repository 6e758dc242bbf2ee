#include "coplanar.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "expansions.h"
#include "modular.h"
#include "pages.h"
#include "predicates.h"
#include "workers.h"

namespace voxkernel {
namespace {

constexpr Index kBlock = 256;
constexpr Index kMany = 1 << 16;                   // keys that are held at a time
constexpr Index kLeast = 1 << 13;                  // half-spaces that are worth a thread
constexpr int kMostParts = 8;                      // of the heads, each with a note for every vertex
constexpr std::uint64_t kOdd = ~std::uint64_t{0};  // of planes whose numbers are all 0 modulo the prime

using Plane = std::array<Residue, 4>;

bool is_within_range(double value) {
  const double size = std::abs(value);
  return size == 0.0 || (size >= 0x1p-300 && size <= 0x1p300);
}

// Whether the exact predicates cover all numbers of a half-space.
bool is_within_range(const InputPlanes& sources, const Index* ids) {
  if (ids[0] < 0) {
    const double* plane = sources.explicit_planes[-1 - ids[0]];
    return std::all_of(plane, plane + 4, [](double value) { return is_within_range(value); });
  }
  return std::all_of(ids, ids + 3, [&](Index v) {
    const double* p = sources.vertices[v];
    return is_within_range(p[0]) && is_within_range(p[1]) && is_within_range(p[2]);
  });
}

bool are_within_range(const InputPlanes& sources, int threads, Stop& stop) {
  std::atomic<bool> found{true};
  run_stretches(sources.corners.size(), kLeast, threads, stop, [&](Index first, Index last, Stop& own) {
    for (Index i = first; i < last && found.load(std::memory_order_relaxed); ++i) {
      own.poll();
      if (!is_within_range(sources, sources.corners[i])) found = false;
    }
  });
  return found;
}

// (a, b, c, d) of the plane a x + b y + c z = d, modulo the prime.
Plane plane_residues(const InputPlanes& sources, const Index* ids) {
  if (ids[0] < 0) {
    const double* given = sources.explicit_planes[-1 - ids[0]];
    return {residue_of(given[0]), residue_of(given[1]), residue_of(given[2]), residue_of(given[3])};
  }
  Residue p[3], u[3], v[3];
  for (int k = 0; k < 3; ++k) {
    p[k] = residue_of(sources.vertices(ids[0], k));
    u[k] = subtracted(residue_of(sources.vertices(ids[1], k)), p[k]);
    v[k] = subtracted(residue_of(sources.vertices(ids[2], k)), p[k]);
  }
  const auto minor = [&](int i, int j) { return subtracted(multiplied(u[i], v[j]), multiplied(u[j], v[i])); };
  const Residue a = minor(1, 2), b = minor(2, 0), c = minor(0, 1);
  return {a, b, c, added(added(multiplied(a, p[0]), multiplied(b, p[1])), multiplied(c, p[2]))};
}

std::uint64_t mixed(const Plane& plane, Residue factor) {
  std::uint64_t key = 0;
  for (const Residue part : plane) {
    key = (key ^ multiplied(part, factor)) * 0x9e3779b97f4a7c15u;
    key ^= key >> 29;
  }
  return key == kOdd ? 0 : key;
}

// Keys of a block of half-spaces, the same for all that lie on one plane: their numbers over the first one that is not
// 0. One division serves them all (Montgomery): the product of all divisors is inverted, and taken apart again.
void fill_keys(const InputPlanes& sources, Index first, Index last, std::uint64_t* keys) {
  Plane planes[kBlock];
  Residue divisors[kBlock], before[kBlock];
  Residue product = 1;
  for (Index i = first; i < last; ++i) {
    Plane& plane = planes[i - first];
    plane = plane_residues(sources, sources.corners[i]);
    const auto* head = std::find_if(plane.begin(), plane.end(), [](Residue part) { return part != 0; });
    divisors[i - first] = head == plane.end() ? 0 : *head;
    before[i - first] = product;
    if (head != plane.end()) product = multiplied(product, *head);
  }
  Residue inverse = inverted(product);
  for (Index k = last - first - 1; k >= 0; --k) {
    if (divisors[k] == 0) {
      keys[k] = kOdd;
      continue;
    }
    keys[k] = mixed(planes[k], multiplied(inverse, before[k]));
    inverse = multiplied(inverse, divisors[k]);
  }
}

// a x + b y + c z = d for doubles, exactly; products of two numbers in range are multiples of 2**-704 and below 2**600.
bool lies_on(const double* plane, const double* p) {
  Expansion<2> terms[4];
  for (int k = 0; k < 4; ++k) {
    const HighLow product = two_product(plane[k], k < 3 ? p[k] : -1.0);
    terms[k].push(product.low);
    terms[k].push(product.high);
  }
  return sum(sum(terms[0], terms[1]), sum(terms[2], terms[3])).size == 0;
}

bool are_proportional(const double* p, const double* q) {
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < i; ++j) {
      if (difference_of_products(p[i], q[j], p[j], q[i]).size != 0) return false;
    }
  }
  return true;
}

// Half-spaces that found a plane, and the exact tests of others against them.
class Heads {
 public:
  Heads(Points normals, const InputPlanes& sources) : normals_(normals), sources_(sources), slots_(64, Slot{0, -1}) {
    // Neighbours share corners; of a few facets of a large surface nothing is kept.
    if (sources.vertices.size() <= 4 * sources.corners.size()) known_.assign(sources.vertices.size(), -1);
  }

  // The head of half-space i: one that was put in before, or i itself, which is put in.
  Index head_of(std::uint64_t key, Index i) {
    const auto short_key = static_cast<std::uint32_t>(key);
    std::size_t at = short_key & (slots_.size() - 1);
    for (; slots_[at].head >= 0; at = (at + 1) & (slots_.size() - 1)) {
      if (slots_[at].key == short_key && are_one(slots_[at].head, i)) return slots_[at].head;
    }
    slots_[at] = {short_key, static_cast<std::int32_t>(i)};
    if (2 * static_cast<std::size_t>(++size_) > slots_.size()) grow();
    return i;
  }

  // The same without a key: all heads are tried; -1 where there is none.
  Index find(Index i) {
    for (const Slot& slot : slots_) {
      if (slot.head >= 0 && are_one(slot.head, i)) return slot.head;
    }
    return -1;
  }

 private:
  struct Slot {
    std::uint32_t key;  // half of it: which tells planes apart well enough
    std::int32_t head;  // -1 is a free slot
  };

  bool are_one(Index head, Index i) {
    const double *n = normals_[head], *m = normals_[i];
    // Of planes that are one the rounded unit normals are nearly equal or nearly opposite: the sign is certain.
    return n[0] * m[0] + n[1] * m[1] + n[2] * m[2] > 0.0 && are_coplanar(head, i);
  }

  bool are_coplanar(Index head, Index i) {
    const Index *plane = sources_.corners[head], *other = sources_.corners[i];
    if (plane[0] >= 0 && other[0] >= 0) {
      return has_corner(head, plane, other[0]) && has_corner(head, plane, other[1]) &&
             has_corner(head, plane, other[2]);
    }
    if (plane[0] < 0 && other[0] < 0) {
      return are_proportional(sources_.explicit_planes[-1 - plane[0]], sources_.explicit_planes[-1 - other[0]]);
    }
    if (sources_.is_cone) return false;
    const Index* corners = plane[0] < 0 ? other : plane;
    const double* given = sources_.explicit_planes[-1 - std::min(plane[0], other[0])];
    return std::all_of(corners, corners + 3, [&](Index v) { return lies_on(given, sources_.vertices[v]); });
  }

  bool has_corner(Index head, const Index* plane, Index v) {
    if (v == plane[0] || v == plane[1] || v == plane[2]) return true;
    if (!known_.empty() && known_[v] == head) return true;
    const Points& x = sources_.vertices;
    if (orientation(x[plane[0]], x[plane[1]], x[plane[2]], x[v]) != 0.0) return false;
    if (!known_.empty()) known_[v] = static_cast<std::int32_t>(head);
    return true;
  }

  void grow() {
    Brief<Slot> old(2 * slots_.size(), Slot{0, -1});
    old.swap(slots_);
    for (const Slot& slot : old) {
      if (slot.head < 0) continue;
      std::size_t at = slot.key & (slots_.size() - 1);
      while (slots_[at].head >= 0) at = (at + 1) & (slots_.size() - 1);
      slots_[at] = slot;
    }
  }

  Points normals_;
  const InputPlanes& sources_;
  Brief<Slot> slots_;          // a power of two of them, at most half of them in use
  Brief<std::int32_t> known_;  // the last head on whose plane a vertex was found to lie
  Index size_ = 0;
};

}  // namespace

// Names for each half-space the first one that is exactly coplanar with it and faces the same way.
//
// Half-spaces on one plane have proportional numbers (a, b, c, d), also modulo a prime, so one key; those of one key
// are tested exactly. Where all four are multiples of the prime there is no key, and all planes are tried. So every
// pair is found, in linear time, however many planes are nearly the same. Nothing is grouped where a number in use is
// beyond 2**-300 .. 2**300.
std::vector<Index> coplanar_groups(Points normals, const InputPlanes& sources, int threads, Stop& stop) {
  const Index n = sources.corners.size();
  if (n > std::numeric_limits<std::int32_t>::max()) throw std::length_error("too many half-spaces to be grouped");
  std::vector<Index> groups(n);
  for (Index i = 0; i < n; ++i) groups[i] = i;
  if (!are_within_range(sources, threads, stop)) return groups;
  // Each thread has a part of the keys, and the heads of those.
  const int n_parts = worth_threads(n, kLeast, std::min(threads, kMostParts));
  std::vector<Heads> heads(n_parts, Heads(normals, sources));
  std::vector<std::uint64_t> keys(std::min(n, kMany));
  std::vector<Index> odd;
  for (Index first = 0; first < n; first += kMany) {
    const Index last = std::min(n, first + kMany);
    run_stretches(last - first, kLeast, threads, stop, [&](Index begin, Index end, Stop& own) {
      for (Index i = begin; i < end; i += kBlock) {
        const Index next = std::min(end, i + kBlock);
        own.poll(8 * (next - i));
        fill_keys(sources, first + i, first + next, &keys[i]);
      }
    });
    run_parts(n_parts, stop, [&](int part, Stop& own) {
      for (Index i = first; i < last; ++i) {
        const std::uint64_t key = keys[i - first];
        own.poll();
        if (key == kOdd) {
          if (part == 0) odd.push_back(i);
        } else if (static_cast<int>((key >> 32) * n_parts >> 32) == part) {
          own.poll(7);
          groups[i] = heads[part].head_of(key, i);
        }
      }
    });
  }
  if (odd.empty()) return groups;
  for (const Index i : odd) {
    stop.poll(n);
    Index head = -1;
    for (Heads& part : heads) head = head < 0 ? part.find(i) : head;
    groups[i] = head < 0 ? heads[0].head_of(kOdd, i) : head;
  }
  // Those came last, but may be the first of their group.
  std::vector<Index> least(n, n);
  for (Index i = 0; i < n; ++i) least[groups[i]] = std::min(least[groups[i]], i);
  for (Index i = 0; i < n; ++i) groups[i] = least[groups[i]];
  return groups;
}

std::vector<Index> first_of_planes(Points normals, const InputPlanes& sources, Indices rows, int threads, Stop& stop) {
  std::vector<Index> groups;
  if (rows.size() == normals.size()) {
    groups = coplanar_groups(normals, sources, threads, stop);
  } else {
    Brief<double> some_normals(static_cast<std::size_t>(3) * rows.size());
    Brief<Index> some_corners(static_cast<std::size_t>(3) * rows.size());
    run_stretches(rows.size(), kLeast, threads, stop, [&](Index first, Index last, Stop& own) {
      own.poll(last - first);
      for (Index i = first; i < last; ++i) {
        std::copy_n(normals[rows[i]], 3, some_normals.data() + 3 * i);
        std::copy_n(sources.corners[rows[i]], 3, some_corners.data() + 3 * i);
      }
    });
    InputPlanes some = sources;
    some.corners = {some_corners.data(), rows.size()};
    groups = coplanar_groups({some_normals.data(), rows.size()}, some, threads, stop);
  }
  std::vector<Index> found;
  found.reserve(groups.size());
  for (Index i = 0; i < rows.size(); ++i) {
    if (groups[i] == i) found.push_back(rows[i]);
  }
  return found;
}

}  // namespace voxkernel
