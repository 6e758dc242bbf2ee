#include "feasibility.h"

#include <algorithm>
#include <iterator>

#include "linear_program.h"

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
std::vector<Index> new_rows(std::vector<Index> ids, std::vector<Index> rows) {
  std::sort(ids.begin(), ids.end());
  std::sort(rows.begin(), rows.end());
  std::vector<Index> fresh;
  std::set_difference(std::lower_bound(ids.begin(), ids.end(), 0), ids.end(), rows.begin(), rows.end(),
                      std::back_inserter(fresh));
  return fresh;
}

std::vector<Index> nearest_rows(Points normals, Doubles offsets, const std::vector<Index>& rows, const double* point) {
  struct Near {
    double slack;
    std::size_t position;
  };
  std::vector<Near> order(rows.size());
  for (std::size_t w = 0; w < rows.size(); ++w) {
    const double* n = normals[rows[w]];
    order[w] = {offsets[rows[w]] - (n[0] * point[0] + n[1] * point[1] + n[2] * point[2]), w};
  }
  const std::size_t count = std::min(kExactRows, order.size());
  std::partial_sort(order.begin(), order.begin() + count, order.end(), [](const Near& a, const Near& b) {
    return a.slack < b.slack || (a.slack == b.slack && a.position < b.position);
  });
  std::vector<Index> nearest(count);
  for (std::size_t k = 0; k < count; ++k) nearest[k] = rows[order[k].position];
  return nearest;
}

}  // namespace

// The deepest point of the working set is an upper bound of the depth. Planes that are tighter at it join the set, the
// tightest of each direction, until a point is proven deep enough, the set has no common point, or nothing is new.
DeepPoint find_deep_point(Points normals, Doubles offsets, Doubles errors, Stop& stop) {
  DeepPoint result;
  std::vector<Index>& rows = result.rows = first_rows(offsets.size());
  std::vector<Index> ids(kBins);
  std::vector<double> slacks(kBins);
  Index basis[4] = {1, 3, 5, 6};
  double multipliers[4] = {}, point[4] = {};
  const double* box = std::begin(kBoxes);
  for (int round = 0; round < kMaxRounds; ++round) {
    const Index steps = deepest_point(normals, offsets, rows, *box, {basis, 4}, {multipliers, 4}, {point, 4},
                                      1e-15 * *box, kMaxSteps, stop);
    if (steps < 0) break;
    const double upper = point[3];
    if (upper < 0.0) {
      bool at_box = false;
      for (int j = 0; j < 4; ++j) at_box = at_box || (basis[j] < 6 && multipliers[j] > 1e-13);
      if (at_box) {
        if (++box == std::end(kBoxes)) break;
        continue;
      }
      for (int j = 0; j < 4; ++j) {
        if (basis[j] >= 7 && multipliers[j] > 0.0) result.opposing.push_back(rows[basis[j] - 7]);
      }
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
    rows.insert(rows.end(), fresh.begin(), fresh.end());
  }
  if (result.depth == 0.0) result.nearest = nearest_rows(normals, offsets, rows, point);
  return result;
}

}  // namespace voxkernel
