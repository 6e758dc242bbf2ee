#include "feasibility.h"

#include <algorithm>
#include <iterator>

#include "deepest_point.h"
#include "plane_passes.h"

namespace voxkernel {
namespace {

constexpr double kShare = 0.5;  // a point is deep enough at this share of the proven largest depth
constexpr double kBoxes[] = {4.0, 0x1p12, 0x1p26};
constexpr int kMaxRounds = 60;
constexpr Index kMaxSteps = 400;
constexpr Index kFirstRows = 256;
constexpr std::size_t kExactRows = 48;

// All of few half-spaces, an even sample of many.
std::vector<Index> first_rows(Index n) {
  const Index step = n <= kBins ? 1 : std::max<Index>(1, n / kFirstRows);
  std::vector<Index> rows;
  for (Index i = 0; i < n; i += step) rows.push_back(i);
  return rows;
}

// Those of `ids` that are not yet in the working set, sorted; -1 is no id.
std::vector<Index> new_rows(const std::vector<Index>& ids, std::vector<Index> rows) {
  std::vector<Index> tight, fresh;
  std::copy_if(ids.begin(), ids.end(), std::back_inserter(tight), [](Index id) { return id >= 0; });
  std::sort(tight.begin(), tight.end());
  std::sort(rows.begin(), rows.end());
  std::set_difference(tight.begin(), tight.end(), rows.begin(), rows.end(), std::back_inserter(fresh));
  return fresh;
}

// Those nearest to a point; `planes` are those of `rows`.
std::vector<Index> nearest_rows(const HalfSpaceColumns& planes, const std::vector<Index>& rows, const double* point) {
  struct Near {
    double slack;
    std::size_t position;
  };
  std::vector<Near> order(rows.size());
  for (std::size_t w = 0; w < rows.size(); ++w) order[w] = {planes.slack(static_cast<Index>(w), point), w};
  const std::size_t count = std::min(kExactRows, order.size());
  std::partial_sort(order.begin(), order.begin() + count, order.end(), [](const Near& a, const Near& b) {
    return a.slack < b.slack || (a.slack == b.slack && a.position < b.position);
  });
  std::vector<Index> nearest(count);
  for (std::size_t k = 0; k < count; ++k) nearest[k] = rows[order[k].position];
  return nearest;
}

// Whether a side of the box holds the maximum: in a larger box it is another one.
bool leans_on_box(const DeepestPoint& deepest) {
  for (int j = 0; j < 4; ++j) {
    if (deepest.basis[j] < 6 && deepest.multipliers[j] > 1e-13) return true;
  }
  return false;
}

// The half-spaces that hold the maximum; `rows` are those of the working set.
std::vector<Index> opposing_rows(const DeepestPoint& deepest, const std::vector<Index>& rows) {
  std::vector<Index> opposing;
  for (int j = 0; j < 4; ++j) {
    const Index w = deepest.basis[j] - DeepestPoint::kFirst;
    if (w >= 0 && deepest.multipliers[j] > 0.0) opposing.push_back(rows[w]);
  }
  return opposing;
}

}  // namespace

// The deepest point of the working set is an upper bound of the depth. Planes that are tighter at it join the set, the
// tightest of each direction, until a point is proven deep enough, the set has no common point, or nothing is new.
DeepPoint find_deep_point(Points normals, Doubles offsets, Doubles errors, Stop& stop) {
  DeepPoint result;
  std::vector<Index>& rows = result.rows;
  HalfSpaceColumns planes(0);  // those of `rows`, without errors: the simplex asks for none
  const auto add_rows = [&](const std::vector<Index>& fresh) {
    rows.insert(rows.end(), fresh.begin(), fresh.end());
    planes.reserve(static_cast<Index>(rows.size()));
    for (const Index i : fresh) planes.push(normals[i], offsets[i], 0.0);
  };
  add_rows(first_rows(offsets.size()));
  std::vector<Index> ids(kBins);
  std::vector<double> slacks(kBins);
  DeepestPoint deepest;
  const double* point = deepest.point.data();
  const double* box = std::begin(kBoxes);
  for (int round = 0; round < kMaxRounds; ++round) {
    if (deepest.find(planes, *box, 1e-15 * *box, kMaxSteps, stop) < 0) break;
    const double upper = point[3];
    if (upper < 0.0) {
      if (leans_on_box(deepest)) {
        if (++box == std::end(kBoxes)) break;
        continue;
      }
      result.opposing = opposing_rows(deepest, rows);
      result.gap = -upper;
      break;
    }
    const Tightest found = tightest_by_direction(normals, offsets, errors, point, upper, ids, slacks, stop);
    ++result.passes;
    if (found.certain > 0.0 && found.smallest > result.depth) {
      result.depth = found.smallest;
      std::copy_n(point, 3, result.point);
    }
    const std::vector<Index> fresh = new_rows(ids, rows);
    if ((result.depth > 0.0 && result.depth >= kShare * upper) || fresh.empty()) break;
    add_rows(fresh);
  }
  if (result.depth == 0.0) result.nearest = nearest_rows(planes, rows, point);
  return result;
}

}  // namespace voxkernel
