#include "cells.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "cell_kernel.h"
#include "cell_planes.h"
#include "coplanar.h"
#include "deepest_point.h"
#include "dual_hull.h"
#include "planes.h"
#include "solid_measures.h"
#include "star_hull.h"

namespace voxkernel {
namespace {

enum Outcome : Index {
  kHasBadFace = -5,
  kIsNotFinite = -4,
  kIsInsideOut = -3,
  kIsTurned = -2,
  kIsOpen = -1,
  kUndecided = 0,
  kConvex = 1,
  kSolid = 2,
  kEmpty = 3,
  kEmptyNear = 4,
};

constexpr double kUnitRoundoff = 0x1p-53;
constexpr double kPi = 3.14159265358979323846;
constexpr Index kMaxPlanes = 1024;  // more go to the general code, which is faster there
constexpr Index kMaxCut = 64;       // faces of more are not cut one by one: the dual hull is faster
constexpr int kFarCube = 3;         // half edge, a power of two in units of the frame, that no kernel reaches
constexpr double kThin = 1e-4;      // kernels with less depth for their size are left to the general code
constexpr double kRounding = 1e-9;  // largest relative error of a volume
constexpr double kShare = 1e-10;    // no plane may cut more off a hull
constexpr double kNearly = 1e-11;

// Too thin a kernel for its volume to be right.
bool is_thin(double depth, double extent) {
  return depth < kThin * extent || kUnitRoundoff * extent * extent > kRounding * depth * depth;
}

class CellSolver {
 public:
  CellSolver(const CellMesh& mesh, Span<const bool> flips, CellSizes largest, double rtol, Stop& stop);

  // What decided a cell; the numbers of its row are filled as far as known.
  Outcome solve(Index cell, double* numbers, double* center, Index* witness);

 private:
  bool set_planes();
  Outcome solve_empty(double volume, Index* witness) const;
  Outcome solve_solid(double volume, double* numbers, double* center);
  double cut_volume(const double* center, double depth);
  double star_volume(const double* center, double depth);
  double hull_volume(const double* center, double depth) const;

  const CellMesh& mesh_;
  Span<const bool> flips_;
  double rtol_;
  Stop& stop_;
  Cell cell_;
  EdgeCheck edges_;
  Frame frame_{};
  std::vector<double> local_;
  PolygonPlanes polygons_;
  std::vector<double> normals_, offsets_, areas_, errors_;
  HalfSpaceColumns planes_;
  double largest_error_ = 0.0;  // of the planes of three corners, whichever they are
  DeepestPoint deepest_;
  ConvexityTest convexity_;
  FaceCutter cutter_;
  StarHull star_;

  Points local() const { return {local_.data(), cell_.n_vertices}; }
};

CellSolver::CellSolver(const CellMesh& mesh, Span<const bool> flips, CellSizes largest, double rtol, Stop& stop)
    : mesh_(mesh),
      flips_(flips),
      rtol_(rtol),
      stop_(stop),
      cell_(mesh, largest),
      edges_(largest.corners),
      local_(3 * largest.corners),
      polygons_(largest.corners),
      normals_(3 * std::min(largest.corners, kMaxPlanes)),
      offsets_(std::min(largest.corners, kMaxPlanes)),
      areas_(offsets_.size()),
      errors_(offsets_.size()),
      planes_(std::min(largest.corners, kMaxPlanes)),
      convexity_(largest.corners),
      cutter_(std::min(largest.corners, kMaxCut)) {}

// The planes of the cell in its frame, without triangles with two equal corners, which have none; false where one needs
// exact arithmetic.
bool CellSolver::set_planes() {
  const Index n = polygons_.n_planes;
  facet_planes(cell_.points(), {polygons_.corners.data(), n}, frame_.origin, 1.0 / frame_.scale, {normals_.data(), n},
               offsets_, areas_, errors_, stop_);
  planes_.size = 0;
  largest_error_ = 0.0;
  for (Index p = 0; p < n; ++p) {
    if (errors_[p] == -2.0) continue;
    if (errors_[p] < 0.0) return false;
    largest_error_ = std::max(largest_error_, errors_[p]);
    std::copy_n(polygons_.corners.data() + 3 * p, 3, polygons_.corners.data() + 3 * planes_.size);
    polygons_.face[planes_.size] = polygons_.face[p];
    planes_.push(normals_.data() + 3 * p, offsets_[p], errors_[p] + polygons_.extra[p]);
  }
  return planes_.size >= 4;
}

Outcome CellSolver::solve(Index cell, double* numbers, double* center, Index* witness) {
  stop_.poll(100);
  if (!cell_.gather(mesh_, flips_, cell)) return kHasBadFace;
  stop_.poll(10 * cell_.start[cell_.n_faces]);
  frame_ = local_frame(cell_.points());
  const double scale = frame_.scale;
  if (scale == 0.0) return kIsNotFinite;
  const EdgeBalance edges = edges_.balance(cell_);
  if (edges.closing != Closing::kClosed) {
    numbers[0] = static_cast<double>(edges.n_wrong);
    return edges.closing == Closing::kOpen ? kIsOpen : kIsTurned;
  }
  if (scale < 0.0) return kUndecided;
  const double inverse = 1.0 / scale;
  for (Index v = 0; v < 3 * cell_.n_vertices; ++v) local_[v] = (cell_.raw[v] - frame_.origin[v % 3]) * inverse;
  numbers[1] = std::sqrt(squared_diameter(local(), stop_)) * scale;
  if (frame_.largest > kLargest || !polygons_.set(cell_, rtol_, kMaxPlanes, stop_)) return kUndecided;
  auto [volume, doubt] = fan_volume(local(), cell_.polygons());
  numbers[0] = volume / 6.0 * scale * scale * scale;
  if (std::abs(volume) <= doubt || doubt > kRounding * std::abs(volume)) return kUndecided;
  if (volume < 0.0) return kIsInsideOut;
  volume /= 6.0;
  if (!set_planes()) return kUndecided;
  deepest_.basis = DeepestPoint::kCorner;
  if (deepest_.find(planes_, 4.0, 4e-15, 400, stop_) < 0) return kUndecided;
  return deepest_.point[3] < 0.0 ? solve_empty(volume, witness) : solve_solid(volume, numbers, center);
}

Outcome CellSolver::solve_empty(double volume, Index* witness) const {
  const auto& basis = deepest_.basis;
  Outcome outcome = kUndecided;
  if (*std::min_element(basis.begin(), basis.end()) >= DeepestPoint::kFirst) {
    std::array<Index, 4> ids{};
    for (int k = 0; k < 4; ++k) ids[k] = basis[k] - DeepestPoint::kFirst;
    if (proves_empty(planes_, ids.data())) outcome = kEmpty;
  }
  if (outcome == kUndecided) {
    const double area = fan_area(local(), cell_.polygons());
    if (proves_empty_near(planes_, volume, area, deepest_)) outcome = kEmptyNear;
  }
  if (outcome != kUndecided) {
    for (int k = 0; k < 4; ++k) {
      if (basis[k] >= DeepestPoint::kFirst && deepest_.multipliers[k] > 1e-13) {
        witness[k] = polygons_.face[basis[k] - DeepestPoint::kFirst];
      }
    }
  }
  return outcome;
}

Outcome CellSolver::solve_solid(double volume, double* numbers, double* center) {
  const double* best = deepest_.point.data();
  const double size = std::sqrt(best[0] * best[0] + best[1] * best[1] + best[2] * best[2]) + 1.0;
  double depth = std::numeric_limits<double>::infinity(), certain = depth;  // the smallest slack, and a bound on it
  for (Index p = 0; p < planes_.size; ++p) {
    const double slack = planes_.slack(p, best);
    depth = std::min(depth, slack);
    certain = std::min(certain, slack - planes_.error[p] * size);
  }
  if (certain <= 0.0 || 4.0 * largest_error_ > kRounding * depth) return kUndecided;
  auto [excess, is_convex] = convexity_.test(cell_, local(), polygons_, planes_, stop_);
  double kernel = -1.0;
  // Shrunk by excess / depth about the centre, the hull of the vertices is behind all planes.
  if (3.0 * excess <= (is_convex ? kRounding : kNearly) * depth) {
    const double turns = solid_angle(local(), cell_.polygons(), best) / (4.0 * kPi);
    if (std::abs(turns - 1.0) < 0.25) {
      kernel = volume;
    } else {
      is_convex = false;
    }
  }
  if (kernel < 0.0) {
    if (planes_.size <= kMaxCut) kernel = star_volume(best, depth);
    if (kernel < 0.0 && planes_.size <= kMaxCut) kernel = cut_volume(best, depth);
    if (kernel < 0.0) kernel = hull_volume(best, depth);
    if (kernel < 0.0) return kUndecided;
  }
  const double scale = frame_.scale;
  numbers[2] = kernel * scale * scale * scale;
  numbers[3] = depth * scale;
  for (int axis = 0; axis < 3; ++axis) center[axis] = best[axis] * scale + frame_.origin[axis];
  return is_convex ? kConvex : kSolid;
}

// Of a hull in floating point, which most kernels are; negative where it is not certain.
double CellSolver::star_volume(const double* center, double depth) {
  stop_.poll(4 * planes_.size * planes_.size);
  star_.clear();
  for (Index p = 0; p < planes_.size; ++p) {
    const double slack = 0.5 * planes_.slack(p, center);  // half the size, which is inside the cube of the hull
    star_.push(planes_.x[p] / slack, planes_.y[p] / slack, planes_.z[p] / slack);
  }
  double volume, box[6], square = 0.0;
  if (!star_.measure(kShare, {}, &volume, box)) return -1.0;
  for (int axis = 0; axis < 3; ++axis) square += std::max(box[axis] * box[axis], box[axis + 3] * box[axis + 3]);
  return is_thin(depth, 2.0 * std::sqrt(square)) ? -1.0 : 8.0 * volume;
}

// Of the faces, each cut out of its plane; negative where they do not fit together, or the kernel is thin.
double CellSolver::cut_volume(const double* center, double depth) {
  stop_.poll(4 * planes_.size * planes_.size);
  const auto [volume, extent, misfit] = cutter_.cut(planes_, center, kNearly * depth);
  const bool is_wrong = misfit < 0.0 || misfit * extent * extent > kRounding * volume;
  return is_wrong || is_thin(depth, extent) ? -1.0 : volume;
}

// Of the dual hull, where it is known which planes meet where however near to one another they are; negative where the
// kernel is thin. `center` is strictly inside; the bounds are those of `kernel_shape.py`.
double CellSolver::hull_volume(const double* center, double depth) const {
  const Index n = planes_.size;
  std::vector<double> normals(3 * n);
  for (Index p = 0; p < n; ++p) {
    normals[3 * p] = planes_.x[p];
    normals[3 * p + 1] = planes_.y[p];
    normals[3 * p + 2] = planes_.z[p];
  }
  const double scale = frame_.scale;
  double terms[6];
  for (int axis = 0; axis < 3; ++axis) {
    terms[axis] = frame_.origin[axis];
    terms[3 + axis] = center[axis] * scale;
  }
  const LocalPlanes local{
      {normals.data(), n}, {planes_.offset.data(), n}, {planes_.error.data(), n}, center, 0.0, scale};
  const PlaneSource source{cell_.points(), {polygons_.corners.data(), n}, {}, {terms, 2}};
  const InputPlanes sources{source.vertices, source.corners, {}, false};
  std::vector<Index> rows(n);
  std::iota(rows.begin(), rows.end(), Index{0});
  rows = first_of_planes(local.normals, sources, rows, 1, stop_);
  const HullPolytope hull = dual_hull(local, source, std::move(rows), std::ilogb(scale) + kFarCube, 1, stop_);
  if (!hull.is_inside || !hull.is_closed) return -1.0;
  const Points vertices{hull.vertices.data(), static_cast<Index>(hull.vertices.size() / 3)};
  const SolidMeasures found =
      solid_measures(local.normals, local.offsets, center, vertices, hull.start, hull.ring, hull.rows, 1, stop_);
  const double clearance = std::max(depth, found.clearance), slenderness = found.extent / clearance;
  const double rounding = 8.0 * hull.vertex_error / clearance + kUnitRoundoff * slenderness * slenderness + 1e-14;
  return clearance < kThin * found.extent || rounding > kRounding ? -1.0 : found.volume;
}

}  // namespace

void solve_cells(const CellMesh& mesh, Span<const bool> flips, Index first, Index last, double rtol,
                 const CellAnswers& answers, Stop& stop) {
  CellSolver solver(mesh, flips, largest_sizes(mesh, first, last), rtol, stop);
  for (Index cell = first; cell < last; ++cell) {
    answers.outcome[cell] = solver.solve(cell, answers.numbers[cell], answers.center[cell], answers.witness[cell]);
  }
}

}  // namespace voxkernel
