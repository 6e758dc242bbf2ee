#include <nanobind/stl/array.h>

#include "best_voxel.h"
#include "bind.h"
#include "label_boxes.h"
#include "label_depth.h"
#include "label_parts.h"
#include "label_rays.h"
#include "label_segments.h"
#include "label_sums.h"
#include "label_view.h"
#include "star_kernels.h"

namespace voxkernel {
namespace {

using Image = Array<const std::uint8_t, -1, -1, -1>;
using Position = Array<const Index, 3>;

Crop crop_of(const Image& image, bool is_flat) {
  const auto n = [&](int axis) { return static_cast<Index>(image.shape(axis)); };
  return {{image.data(), n(0) * n(1) * n(2)}, {n(0), n(1), n(2)}, is_flat};
}

template <typename T>
void bind_label_boxes(nb::module_& m) {
  m.def(
      "label_boxes",
      [](Array<const T, -1, -1, -1> image, StopFlag* flag) {
        const Index shape[3] = {static_cast<Index>(image.shape(0)), static_cast<Index>(image.shape(1)),
                                static_cast<Index>(image.shape(2))};
        LabelBoxes found = without_lock([&](Stop& stop) { return label_boxes(image.data(), shape, stop); }, flag);
        return std::make_tuple(to_array(std::move(found.labels)), to_array(std::move(found.sizes)),
                               to_rows<6>(std::move(found.boxes)));
      },
      array("image"), stop_argument(),
      "Labels of a piece of an image, but 0, the number of their voxels, and their boxes (first, one behind the "
      "last).");
}

}  // namespace

void bind_labels(nb::module_& m) {
  bind_label_boxes<std::uint8_t>(m);
  bind_label_boxes<std::uint16_t>(m);
  bind_label_boxes<std::uint32_t>(m);
  bind_label_boxes<std::int64_t>(m);
  m.def(
      "touched_voxels",
      [](const Position& from, const Position& to) { return to_rows<3>(touched_voxels(from.data(), to.data())); },
      array("start"), array("end"), "Voxels whose open cube the segment between two voxel centres meets.");
  m.def(
      "squared_depths",
      [](const Image& crop, bool is_flat, Array<const double, 3> spacing, Array<double, -1, -1, -1> depths,
         StopFlag* flag) {
        const Crop object = crop_of(crop, is_flat);
        without_lock([&](Stop& stop) { squared_depths(object, spacing.data(), {depths.data(), object.size()}, stop); },
                     flag);
      },
      array("crop"), nb::arg("is_flat"), array("spacing"), array("depths"), stop_argument(),
      "Fill the squared distance of every voxel of an object from the nearest one outside.");
  m.def(
      "label_parts",
      [](const Image& crop, bool is_flat, StopFlag* flag) {
        const LabelParts parts =
            without_lock([&](Stop& stop) { return label_parts(crop_of(crop, is_flat), stop); }, flag);
        return std::make_tuple(parts.n_fragments, parts.largest_fragment, parts.n_holes, parts.hole_voxels);
      },
      array("crop"), nb::arg("is_flat"), stop_argument(),
      "Number of fragments, voxels of the largest, number of holes, voxels in them.");
  m.def(
      "fill_holes",
      [](const Image& crop, bool is_flat, Array<std::uint8_t, -1, -1, -1> filled, StopFlag* flag) {
        const Crop object = crop_of(crop, is_flat);
        without_lock([&](Stop& stop) { fill_holes(object, {filled.data(), object.size()}, stop); }, flag);
      },
      array("crop"), nb::arg("is_flat"), array("filled"), stop_argument(), "Fill 1 for an object and the holes in it.");
  m.def(
      "line_counts",
      [](const Image& crop, bool is_flat, Array<Index, -1, -1> ij, Array<Index, -1, -1> ik, Array<Index, -1, -1> jk,
         StopFlag* flag) {
        const auto flat = [](const Array<Index, -1, -1>& plane) {
          return Span<Index>(plane.data(), static_cast<Index>(plane.shape(0) * plane.shape(1)));
        };
        const LineCounts counts{flat(ij), flat(ik), flat(jk)};
        without_lock([&](Stop& stop) { line_counts(crop_of(crop, is_flat), counts, stop); }, flag);
      },
      array("crop"), nb::arg("is_flat"), array("ij"), array("ik"), array("jk"), stop_argument(),
      "Fill how many voxels of an object are in each line along an axis, by the other two.");
  m.def(
      "visible_voxels",
      [](const Image& crop, bool is_flat, Position center, Array<std::uint8_t, -1, -1, -1> seen, StopFlag* flag) {
        const Crop object = crop_of(crop, is_flat);
        return without_lock(
            [&](Stop& stop) { return LabelView(object).count(center.data(), {seen.data(), object.size()}, stop); },
            flag);
      },
      array("crop"), nb::arg("is_flat"), array("center"), array("seen"), stop_argument(),
      "Fill 1 for the voxels that a voxel of the object sees, 0 elsewhere; return their number.");
  m.def(
      "visible_count",
      [](const Image& crop, bool is_flat, Position center, StopFlag* flag) {
        return without_lock(
            [&](Stop& stop) { return LabelView(crop_of(crop, is_flat)).count(center.data(), {}, stop); }, flag);
      },
      array("crop"), nb::arg("is_flat"), array("center"), stop_argument(),
      "Number of voxels that a voxel of the object sees.");
  nb::class_<Depths>(m, "Depths", "Which of two voxels of one crop is deeper; not for two threads at once.")
      .def(
          "__init__",
          [](Depths* depths, const Image& crop, bool is_flat, Array<const double, 3> spacing, StopFlag* flag) {
            const Crop object = crop_of(crop, is_flat);
            without_lock([&](Stop& stop) { new (depths) Depths(object, spacing.data(), stop); }, flag);
          },
          array("crop"), nb::arg("is_flat"), array("spacing"), stop_argument(), nb::keep_alive<1, 2>())
      .def(
          "is_deeper", [](const Depths& depths, Index a, Index b) { return depths.is_deeper(a, b); }, nb::arg("a"),
          nb::arg("b"),
          "Whether one voxel of the object is deeper than another one, or as deep and nearer to the centroid, or that, "
          "too, and before it.");
  const auto best_of = [](const Image& crop, bool is_flat, const Depths& depths, Index other, Index always,
                          Index most_steps, StopFlag* flag) {
    const Crop object = crop_of(crop, is_flat);
    const BestVoxel best =
        without_lock([&](Stop& stop) { return best_voxel(object, depths, other, always, most_steps, stop); }, flag);
    return std::make_tuple(best.voxel, best.n_seen, best.upper, best.deepest, best.deepest_seen, best.other_seen,
                           best.n_steps);
  };
  m.def(
      "best_voxel", best_of, array("crop"), nb::arg("is_flat"), nb::arg("depths"), nb::arg("other"), nb::arg("always"),
      nb::arg("most_steps"), stop_argument(),
      "The voxel that sees most, what it sees, a bound on that; the deepest and what it sees; what another one sees, 0 "
      "outside; voxels looked at.");
  m.def(
      "best_voxel",
      [best_of](const Image& crop, bool is_flat, Array<const double, -1, -1, -1> depths, Index other, Index always,
                Index most_steps, StopFlag* flag, std::array<double, 3> spacing) {
        const Crop object = crop_of(crop, is_flat);
        const Depths given(object, spacing.data(), {depths.data(), object.size()});
        return best_of(crop, is_flat, given, other, always, most_steps, flag);
      },
      array("crop"), nb::arg("is_flat"), array("depths"), nb::arg("other"), nb::arg("always"), nb::arg("most_steps"),
      stop_argument(), nb::arg("spacing") = std::array<double, 3>{1.0, 1.0, 1.0},
      "The same for the numbers of `squared_depths`.");
  m.def(
      "ray_lengths",
      [](const Image& crop, bool is_flat, Position center, Array2<const double, 3> directions, bool is_stepped,
         Array1<double> lengths, StopFlag* flag) {
        without_lock(
            [&](Stop& stop) {
              ray_lengths(crop_of(crop, is_flat), center.data(), rows(directions),
                          is_stepped ? RayEnd::kStepped : RayEnd::kExact, span(lengths), stop);
            },
            flag);
      },
      array("crop"), nb::arg("is_flat"), array("center"), array("directions"), nb::arg("is_stepped"), array("lengths"),
      stop_argument(), "Fill the lengths of rays to the end of an object, in multiples of their directions.");
  nb::class_<StarRaster>(m, "StarRaster", "Counts the voxels of star-shaped bodies in one crop.")
      .def(
          "__init__",
          [](StarRaster* raster, const Image& crop, bool is_flat) { new (raster) StarRaster(crop_of(crop, is_flat)); },
          array("crop"), nb::arg("is_flat"), nb::keep_alive<1, 2>())
      .def(
          "count",
          [](StarRaster& raster, Position center, Array2<const double, 3> ends, Array2<const Index, 3> faces,
             Position low, Position high, StopFlag* flag) {
            const StarCount count = without_lock(
                [&](Stop& stop) {
                  return raster.count(center.data(), rows(ends), rows(faces), low.data(), high.data(), stop);
                },
                flag);
            return std::make_tuple(count.size, count.common);
          },
          array("center"), array("ends"), array("faces"), array("low"), array("high"), stop_argument(),
          "Voxels in the body and the image, and those also in the object.");
  m.def(
      "star_kernels",
      [](Array2<const double, 3> directions, Array2<const Index, 3> faces, Array<const double, -1, -1> distances,
         Index first, Index last, Array1<double> volumes, Array2<double, 6> boxes, Array1<std::int8_t> outcomes,
         StopFlag* flag) {
        const StarKernelAnswers answers{span(volumes), rows(boxes), span(outcomes)};
        without_lock(
            [&](Stop& stop) {
              star_kernels(rows(directions), rows(faces),
                           {distances.data(), static_cast<Index>(distances.shape(0) * distances.shape(1))}, first, last,
                           answers, stop);
            },
            flag);
      },
      array("directions"), array("faces"), array("distances"), nb::arg("first"), nb::arg("last"), array("volumes"),
      array("boxes"), array("outcomes"), stop_argument(),
      "Fill volume, box and outcome of the kernels of star polyhedra first .. last - 1 about 0.");
}

}  // namespace voxkernel
