#include "feasibility.h"

#include <algorithm>
#include <iterator>

#include "plane_passes.h"

namespace voxkernel {
namespace {

constexpr double kShare = 0.5;  // a point is deep enough at this share of the proven largest depth
constexpr double kBoxes[] = {4.0, 0x1p12, 0x1p26};
constexpr int kMaxRounds = 60;
constexpr Index kMaxSteps = 400;
constexpr Index kFirstRows = 256;
constexpr std::size_t kExactRows = 48;

}  // namespace

std::vector<Index> DeepPointSearch::first_rows(Index n) {
  const Index step = n <= kBins ? 1 : std::max<Index>(1, n / kFirstRows);
  std::vector<Index> rows;
  for (Index i = 0; i < n; i += step) rows.push_back(i);
  return rows;
}

void DeepPointSearch::add(Indices rows, Points normals, Doubles offsets) {
  found_.rows.insert(found_.rows.end(), rows.begin(), rows.end());
  planes_.reserve(static_cast<Index>(found_.rows.size()));
  for (Index i = 0; i < rows.size(); ++i) planes_.push(normals[i], offsets[i], 0.0);
}

bool DeepPointSearch::propose(Stop& stop) {
  while (round_++ < kMaxRounds) {
    const double box = kBoxes[box_];
    if (deepest_.find(planes_, box, 1e-15 * box, kMaxSteps, stop) < 0) return false;
    if (upper() >= 0.0) return true;
    if (!leans_on_box()) {
      for (int j = 0; j < 4; ++j) {
        const Index w = deepest_.basis[j] - DeepestPoint::kFirst;
        if (w >= 0 && deepest_.multipliers[j] > 0.0) found_.opposing.push_back(found_.rows[w]);
      }
      found_.gap = -upper();
      return false;
    }
    if (++box_ == static_cast<int>(std::size(kBoxes))) return false;
  }
  return false;
}

// Whether a side of the box holds the maximum: in a larger box it is another one.
bool DeepPointSearch::leans_on_box() const {
  for (int j = 0; j < 4; ++j) {
    if (deepest_.basis[j] < 6 && deepest_.multipliers[j] > 1e-13) return true;
  }
  return false;
}

std::vector<Index> DeepPointSearch::fresh(Indices ids) const {
  std::vector<Index> tight, known = found_.rows, fresh;
  std::copy_if(ids.begin(), ids.end(), std::back_inserter(tight), [](Index id) { return id >= 0; });
  std::sort(tight.begin(), tight.end());
  std::sort(known.begin(), known.end());
  std::set_difference(tight.begin(), tight.end(), known.begin(), known.end(), std::back_inserter(fresh));
  return fresh;
}

bool DeepPointSearch::judge(double smallest, double certain, bool is_any_new) {
  ++found_.passes;
  if (certain > 0.0 && smallest > found_.depth) {
    found_.depth = smallest;
    std::copy_n(point(), 3, found_.point);
  }
  return is_any_new && (found_.depth == 0.0 || found_.depth < kShare * upper());
}

DeepPoint DeepPointSearch::result() const {
  DeepPoint result = found_;
  if (result.depth == 0.0) result.nearest = nearest_rows();
  return result;
}

// The members of the working set nearest to the last point.
std::vector<Index> DeepPointSearch::nearest_rows() const {
  struct Near {
    double slack;
    std::size_t position;
  };
  std::vector<Near> order(found_.rows.size());
  for (std::size_t w = 0; w < order.size(); ++w) order[w] = {planes_.slack(static_cast<Index>(w), point()), w};
  const std::size_t count = std::min(kExactRows, order.size());
  std::partial_sort(order.begin(), order.begin() + count, order.end(), [](const Near& a, const Near& b) {
    return a.slack < b.slack || (a.slack == b.slack && a.position < b.position);
  });
  std::vector<Index> nearest(count);
  for (std::size_t k = 0; k < count; ++k) nearest[k] = found_.rows[order[k].position];
  return nearest;
}

DeepPoint find_deep_point(Points normals, Doubles offsets, Doubles errors, int threads, Stop& stop) {
  DeepPointSearch search;
  const auto add = [&](const std::vector<Index>& rows) {
    std::vector<double> n, d;
    for (const Index i : rows) {
      n.insert(n.end(), normals[i], normals[i] + 3);
      d.push_back(offsets[i]);
    }
    search.add(rows, {n.data(), static_cast<Index>(rows.size())}, d);
  };
  add(DeepPointSearch::first_rows(offsets.size()));
  std::vector<Index> ids(kBins);
  std::vector<double> slacks(kBins);
  while (search.propose(stop)) {
    const Tightest found =
        tightest_by_direction(normals, offsets, errors, search.point(), search.upper(), ids, slacks, threads, stop);
    const std::vector<Index> fresh = search.fresh(ids);
    if (!search.judge(found.smallest, found.certain, !fresh.empty())) break;
    add(fresh);
  }
  return search.result();
}

}  // namespace voxkernel
