#include "field.h"

#include <utility>

#include "avx2.h"
#include "plane_list.h"

namespace voxkernel {
namespace {

// The value of a plane at the centre of voxel (0, 0, 0) of a brick, and its change along the axes.
struct PointPlane {
  double corner, ax, ay, az;

  PointPlane(const PlaneView& p, Index t, double half)
      : ax(2.0 * half * p.x[t]), ay(2.0 * half * p.y[t]), az(2.0 * half * p.z[t]) {
    corner = p.value[t] - 3.5 * (ax + ay + az);
  }
};

void add_points_plain(const PlaneView& p, Index first, Index last, double half, Index* sums) {
  for (Index t = first; t < last; ++t) {
    const PointPlane plane(p, t, half);
    const Index w = p.weight[t];
    for (int c = 0; c < 64; ++c) {
      const double at_zero = plane.corner + plane.ax * (c >> 3) + plane.ay * (c & 7);
      for (int z = 0; z < 8; ++z) sums[8 * c + z] += at_zero + plane.az * z > 0.0 ? w : 0;
    }
  }
}

#ifdef VOXKERNEL_HAS_AVX2

VOXKERNEL_AVX2 void add_points_avx2(const PlaneView& p, Index first, Index last, double half, Index* sums) {
  const __m256d zero = _mm256_setzero_pd();
  // Two planes at a time, so that every sum is loaded and stored half as often; the last may be a plane of no weight.
  for (Index t = first; t < last; t += 2) {
    const PointPlane one(p, t, half), two(p, t + 1 < last ? t + 1 : t, half);
    const __m256i w1 = _mm256_set1_epi64x(p.weight[t]), w2 = _mm256_set1_epi64x(t + 1 < last ? p.weight[t + 1] : 0);
    const __m256d low_z = _mm256_setr_pd(0, 1, 2, 3), high_z = _mm256_setr_pd(4, 5, 6, 7);
    const __m256d low1 = _mm256_mul_pd(_mm256_set1_pd(one.az), low_z),
                  high1 = _mm256_mul_pd(_mm256_set1_pd(one.az), high_z),
                  low2 = _mm256_mul_pd(_mm256_set1_pd(two.az), low_z),
                  high2 = _mm256_mul_pd(_mm256_set1_pd(two.az), high_z);
    for (int c = 0; c < 64; ++c) {
      const __m256d at1 = _mm256_set1_pd(one.corner + one.ax * (c >> 3) + one.ay * (c & 7)),
                    at2 = _mm256_set1_pd(two.corner + two.ax * (c >> 3) + two.ay * (c & 7));
      auto* at = reinterpret_cast<__m256i*>(sums + 8 * c);
      const __m256i low = _mm256_add_epi64(kept_if(_mm256_cmp_pd(_mm256_add_pd(at1, low1), zero, _CMP_GT_OQ), w1),
                                           kept_if(_mm256_cmp_pd(_mm256_add_pd(at2, low2), zero, _CMP_GT_OQ), w2));
      const __m256i high = _mm256_add_epi64(kept_if(_mm256_cmp_pd(_mm256_add_pd(at1, high1), zero, _CMP_GT_OQ), w1),
                                            kept_if(_mm256_cmp_pd(_mm256_add_pd(at2, high2), zero, _CMP_GT_OQ), w2));
      _mm256_storeu_si256(at, _mm256_add_epi64(_mm256_loadu_si256(at), low));
      _mm256_storeu_si256(at + 1, _mm256_add_epi64(_mm256_loadu_si256(at + 1), high));
    }
  }
}

#endif

// Adds to sums (512,), entry 64 x + 8 y + z, the weight of the planes that each voxel centre of a brick violates.
void add_points(const PlaneView& p, Index first, Index last, double half, Index* sums) {
#ifdef VOXKERNEL_HAS_AVX2
  if (has_avx2) return add_points_avx2(p, first, last, half, sums);
#endif
  add_points_plain(p, first, last, half, sums);
}

// A cell whose children are open, its lists of domain and facet planes, and what is known of the children.
struct Cell {
  Index ijk[3];
  Index begin, middle, end;
  Index violated;
  int next;  // child
  Side sides[8];
  Weights children[8];
};

class FieldOctree {
 public:
  FieldOctree(const FieldPlanes& planes, Index most, double units, int depth, Stop& stop)
      : planes_(3 * planes.offsets.size() + 1024),
        cells_(depth + 3),
        most_(most),
        units_(units),
        depth_(depth),
        stop_(stop) {
    const PlaneView p = planes_.view();
    const Index n = planes.offsets.size();
    for (Index i = 0; i < n; ++i) {
      const double* a = planes.normals[i];
      p.x[i] = a[0];
      p.y[i] = a[1];
      p.z[i] = a[2];
      p.reach[i] = planes.reach[i];
      p.value[i] = 0.5 * (a[0] + a[1] + a[2]) - planes.offsets[i];
      p.weight[i] = planes.weights[i];
    }
    // Slot l + 1 is a cell of level l; slot 0 has one child, the cube.
    cells_[0].middle = planes.n_domain;
    cells_[0].end = n;
  }

  ViolationCells run() {
    look_at_children(0);
    for (int slot = 0; slot >= 0;) {
      if (cells_[slot].next == 8) {
        --slot;
      } else if (enter_child(slot)) {
        look_at_children(++slot);
      }
    }
    return std::move(found_);
  }

 private:
  void look_at_children(int slot) {
    Cell& cell = cells_[slot];
    voxkernel::look_at_children(cell, planes_.view(), slot, most_ - cell.violated, stop_);
  }

  // Samples the next child of a cell, or drops it; whether it is to be divided and has become the next cell.
  bool enter_child(int slot) {
    Cell& cell = cells_[slot];
    const int level = slot, c = cell.next;
    cell.next = slot == 0 ? 8 : c + 1;
    const Index certain = cell.violated + cell.children[c].certain;
    if (cell.sides[c] == Side::outside || certain > most_) return false;
    Cell& child = cells_[slot + 1];
    std::fill_n(child.ijk, 3, Index{0});
    if (slot > 0) child_cell(cell.ijk, c, child.ijk);
    if (cell.sides[c] == Side::inside && certain == cell.violated + cell.children[c].possible) {
      found_.tiles.add(child.ijk, depth_ - level);
      found_.tile_values.push_back(static_cast<float>(static_cast<double>(certain) / units_));
      return false;
    }
    const Step step = slot == 0 ? step_to_cube() : step_to_child(c, half_edge(level));
    stop_.poll(cell.end - cell.begin);
    planes_.reserve(cell.end + (cell.end - cell.begin));
    const PlaneView p = planes_.view();
    child.begin = cell.end;
    child.middle = keep_crossing(p, cell.begin, cell.middle, cell.end, step);
    child.end = keep_crossing(p, cell.middle, cell.end, child.middle, step);
    child.violated = certain;
    child.next = 0;
    if (level < depth_ - 3) return true;
    sample(child);
    return false;
  }

  void sample(const Cell& brick) {
    const double half = half_edge(depth_);
    const PlaneView p = planes_.view();
    stop_.poll(64 * (brick.end - brick.begin) + 512);
    alignas(32) Index sums[512], beyond[512];
    std::fill_n(sums, 512, brick.violated);
    std::fill_n(beyond, 512, Index{0});
    add_points(p, brick.middle, brick.end, half, sums);
    add_points(p, brick.begin, brick.middle, half, beyond);
    Word mask[8], some = 0;
    for (int word = 0; word < 8; ++word) {
      mask[word] = 0;
      for (int bit = 0; bit < 64; ++bit) {
        const int v = 64 * word + bit;
        mask[word] |= static_cast<Word>(sums[v] <= most_ && beyond[v] == 0) << bit;
      }
      some |= mask[word];
    }
    if (some == 0) return;
    for (const Index i : brick.ijk) found_.leaf_ijk.push_back(static_cast<std::int32_t>(i << 3));
    found_.leaf_mask.insert(found_.leaf_mask.end(), mask, mask + 8);
    for (const Index sum : sums) {
      found_.leaf_values.push_back(static_cast<float>(static_cast<double>(sum) / units_));
    }
  }

  PlaneList planes_;
  std::vector<Cell> cells_;
  ViolationCells found_;
  Index most_;
  double units_;
  int depth_;
  Stop& stop_;
};

}  // namespace

// Samples the violated weight on the unit cube, 2**depth voxels an edge, where it may be at most `most`.
//
// Values are weights over `units`; voxels are active where the centre is inside the domain planes and violates at
// most `most`.
ViolationCells violation_cells(const FieldPlanes& planes, Index most, double units, int depth, Stop& stop) {
  return FieldOctree(planes, most, units, depth, stop).run();
}

}  // namespace voxkernel
