#include "field.h"

#include <utility>

#include "avx2.h"
#include "brick_columns.h"

namespace voxkernel {
namespace {

void add_points_plain(const PlaneView& p, Index first, Index last, double half, Index* sums) {
  for (Index t = first; t < last; ++t) {
    const VoxelSteps step(p, t, half);
    const double corner = step.corner(p.value[t]);
    const Index w = p.weight[t];
    for (int c = 0; c < 64; ++c) {
      const double at_zero = corner + step.x * (c >> 3) + step.y * (c & 7);
      for (int z = 0; z < 8; ++z) sums[8 * c + z] += at_zero + step.z * z > 0.0 ? w : 0;
    }
  }
}

#ifdef VOXKERNEL_HAS_AVX2

VOXKERNEL_AVX2 void add_points_avx2(const PlaneView& p, Index first, Index last, double half, Index* sums) {
  const __m256d zero = _mm256_setzero_pd();
  // Two planes at a time, so that every sum is loaded and stored half as often; the last may be a plane of no weight.
  for (Index t = first; t < last; t += 2) {
    const Index next = t + 1 < last ? t + 1 : t;
    const VoxelSteps one(p, t, half), two(p, next, half);
    const double corner1 = one.corner(p.value[t]), corner2 = two.corner(p.value[next]);
    const __m256i w1 = _mm256_set1_epi64x(p.weight[t]), w2 = _mm256_set1_epi64x(t + 1 < last ? p.weight[t + 1] : 0);
    const __m256d low_z = _mm256_setr_pd(0, 1, 2, 3), high_z = _mm256_setr_pd(4, 5, 6, 7);
    const __m256d low1 = _mm256_mul_pd(_mm256_set1_pd(one.z), low_z),
                  high1 = _mm256_mul_pd(_mm256_set1_pd(one.z), high_z),
                  low2 = _mm256_mul_pd(_mm256_set1_pd(two.z), low_z),
                  high2 = _mm256_mul_pd(_mm256_set1_pd(two.z), high_z);
    for (int c = 0; c < 64; ++c) {
      const __m256d at1 = _mm256_set1_pd(corner1 + one.x * (c >> 3) + one.y * (c & 7)),
                    at2 = _mm256_set1_pd(corner2 + two.x * (c >> 3) + two.y * (c & 7));
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

class FieldOctree {
 public:
  FieldOctree(const CubePlanes& planes, Index most, double units, int depth, Stop& stop)
      : descent_(planes.offsets.size(), depth + 3, stop), most_(most), units_(units), depth_(depth), stop_(stop) {
    list_planes(planes, descent_.planes);
    descent_.open_first(0, planes.n_domain, planes.offsets.size());
  }

  ViolationCells run() {
    look_at_children(0);
    descent_.run(0, [this](int slot) { return enter_child(slot); });
    return std::move(found_);
  }

 private:
  void look_at_children(int slot) {
    descent_.look_at_children(slot, CellLimits{}, most_ - descent_.cells[slot].violated);
  }

  // Samples the next child of a cell, or drops it; whether it is to be divided.
  bool enter_child(int slot) {
    WeighedCell& cell = descent_.cells[slot];
    const int level = slot, c = cell.next++;
    const Index certain = cell.violated + cell.children[c].certain;
    if (cell.sides[c] == Side::outside || certain > most_) return false;
    Index ijk[3];
    child_cell(cell.ijk, c, ijk);
    if (cell.sides[c] == Side::inside && certain == cell.violated + cell.children[c].possible) {
      found_.tiles.add(ijk, depth_ - level);
      found_.tile_values.push_back(value_of(certain));
      return false;
    }
    WeighedCell& child = descent_.narrow(slot, c);
    child.violated = certain;
    if (level < depth_ - 3) {
      look_at_children(slot + 1);
      return true;
    }
    sample(child);
    return false;
  }

  void sample(const WeighedCell& brick) {
    const double half = half_edge(depth_);
    const PlaneView p = descent_.planes.view();
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
    add_corner(found_.leaf_ijk, brick.ijk, 3);
    found_.leaf_mask.insert(found_.leaf_mask.end(), mask, mask + 8);
    for (const Index sum : sums) found_.leaf_values.push_back(value_of(sum));
  }

  float value_of(Index weight) const { return static_cast<float>(static_cast<double>(weight) / units_); }

  Descent<WeighedCell, false, true> descent_;
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
ViolationCells violation_cells(const CubePlanes& planes, Index most, double units, int depth, Stop& stop) {
  return FieldOctree(planes, most, units, depth, stop).run();
}

}  // namespace voxkernel
