#include "facet_lists.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace voxkernel {
namespace {

constexpr Index kBlock = 512;
constexpr Index kAhead = 24;  // places of planes that the processor is told of before
constexpr Index kFewPlanes = 4096;
constexpr Index kShareOfPlanes = 4;  // a list with one in so many planes of a surface is short

}  // namespace

FacetLists::FacetLists(const FramedPlanes& facets)
    : facets_(facets),
      most_planes_(std::max(kFewPlanes, facets.offsets.size() / kShareOfPlanes)),
      ids_(facets.offsets.size() > most_planes_ ? 2 * facets.offsets.size() : 0),
      children_(ids_.size()),
      children_of_all_(ids_.size() / 2),
      planes_(3 * std::min(most_planes_, facets.offsets.size()) + 1024),
      block_(kBlock + kSlack) {
  if (facets.offsets.size() > static_cast<Index>(std::numeric_limits<std::uint32_t>::max()))
    throw std::length_error("there must be fewer than 2**32 planes");
}

FacetLists::List FacetLists::all() {
  const Index n = facets_.offsets.size();
  if (n > most_planes_) return {0, n, List::Kind::all, false};
  planes_.reserve(n);
  const double middle[3] = {0.5, 0.5, 0.5};
  put_into_cube({nullptr, 0}, n, middle, planes_.view());
  return {0, n, List::Kind::planes, false};
}

FacetLists::Numbers FacetLists::numbers_of(const List& list, Index begin) const {
  if (list.kind == List::Kind::all) return {nullptr, begin};
  return {ids_.data() + begin, 0};
}

// Writes the first n of some planes, with their values at a centre.
void FacetLists::put_into_cube(const Numbers& numbers, Index n, const double* centre, const PlaneView& planes) const {
  const CubeFrame& frame = facets_.frame;
  const double* m = frame.axes;
  for (Index t = 0; t < n; ++t) {
    const Index i = numbers[t];
#if defined(__GNUC__)
    const Index soon = numbers[std::min(t + kAhead, n - 1)];
    __builtin_prefetch(facets_.normals.data() + 3 * soon);
    __builtin_prefetch(facets_.offsets.data() + soon);
    __builtin_prefetch(facets_.errors.data() + soon);
    __builtin_prefetch(facets_.weights.data() + soon);
#endif
    const double* a = facets_.normals[i];
    const double normal[3] = {m[0] * a[0] + m[1] * a[1] + m[2] * a[2], m[3] * a[0] + m[4] * a[1] + m[5] * a[2],
                              m[6] * a[0] + m[7] * a[1] + m[8] * a[2]};
    const double moved = normal[0] * frame.along[0] + normal[1] * frame.along[1] + normal[2] * frame.along[2];
    const double offset = facets_.offsets[i] * frame.scale + moved;
    const double at_centre = normal[0] * centre[0] + normal[1] * centre[1] + normal[2] * centre[2];
    planes.set(t, normal, std::abs(normal[0]) + std::abs(normal[1]) + std::abs(normal[2]), at_centre - offset);
    planes.pad[t] = facets_.errors[i] * frame.error_factor + frame.least_pad;
    planes.weight[t] = facets_.weights[i];
  }
}

void FacetLists::weigh_children(const List& list, const double* centre, double h, int wanted,
                                const CentreLimits& limits, Weights (&children)[8], Stop& stop) {
  if (list.kind == List::Kind::planes) {
    stop.poll(8 * list.size() + 8);
    weights_of_children(planes_.view(), list.begin, list.end, h, kNoLimit, wanted, limits, children);
    return;
  }
  for (Weights& child : children) child = Weights{};
  const PlaneView block = block_.view();
  for (Index begin = list.begin; begin < list.end; begin += kBlock) {
    const Index n = std::min(kBlock, list.end - begin);
    stop.poll(12 * n);
    put_into_cube(numbers_of(list, begin), n, centre, block);
    Weights more[8];
    weights_of_children(block, 0, n, h, kNoLimit, wanted, limits, more);
    for (int c = 0; c < 8; ++c) {
      children[c].certain += more[c].certain;
      children[c].possible += more[c].possible;
    }
  }
}

// Notes for each of a long list which children it may cross: decided as `weigh_children` does, on the same numbers, so
// that what is certain for a child is counted once.
void FacetLists::find_children(List& list, const double* centre, double h, Stop& stop) {
  std::uint8_t* const found = (list.kind == List::Kind::all ? children_of_all_ : children_).data() + list.begin;
  const PlaneView block = block_.view();
  for (Index begin = list.begin; begin < list.end; begin += kBlock) {
    const Index n = std::min(kBlock, list.end - begin);
    stop.poll(12 * n);
    put_into_cube(numbers_of(list, begin), n, centre, block);
    crossed_children(block, n, h, found + (begin - list.begin));
  }
  list.knows_children = true;
}

FacetLists::List FacetLists::narrow(List& list, const double* centre, int c, double h, const double* to, Stop& stop) {
  stop.poll(16 + list.size());
  if (list.kind == List::Kind::planes) {
    planes_.reserve(list.end + list.size());
    const Index end = keep_crossing<true>(planes_.view(), list.begin, list.end, list.end, child_step(c, h));
    return {list.end, end, list.kind, false};
  }
  if (!list.knows_children) find_children(list, centre, h, stop);
  const bool is_all = list.kind == List::Kind::all;
  const Index first = is_all ? 0 : list.end;
  ids_.reserve(first + list.size());
  children_.reserve(ids_.size());
  const std::uint8_t* const found = (is_all ? children_of_all_ : children_).data();
  std::uint32_t* const ids = ids_.data();
  Index end = first;
  for (Index t = list.begin; t < list.end; ++t) {
    ids[end] = is_all ? static_cast<std::uint32_t>(t) : ids[t];
    end += found[t] >> c & 1;
  }
  if (end - first > most_planes_) return {first, end, List::Kind::numbers, false};
  planes_.reserve(end - first);
  put_into_cube({ids + first, 0}, end - first, to, planes_.view());
  return {0, end - first, List::Kind::planes, false};
}

}  // namespace voxkernel
