#include "bind.h"
#include "octree.h"
#include "open_weights.h"
#include "relaxed.h"

namespace voxkernel {

void bind_octree(nb::module_& m) {
  m.def(
      "exact_cells",
      [](Array2<const double, 3> normals, Array1<const double> offsets, Array1<const double> reach,
         Array1<const double> pads, int depth, bool count_only) {
        ExactCells found = without_lock([&](Stop& stop) {
          return exact_cells(rows(normals), span(offsets), span(reach), span(pads), depth, count_only, stop);
        });
        return std::make_tuple(to_rows<3>(std::move(found.tiles.ijk)), to_array(std::move(found.tiles.log2)),
                               to_rows<3>(std::move(found.leaves.ijk)), to_rows<8>(std::move(found.leaves.inside)),
                               to_rows<8>(std::move(found.leaves.boundary)), found.n_inside, found.n_boundary);
      },
      array("normals"), array("offsets"), array("reach"), array("pads"), nb::arg("depth"), nb::arg("count_only"),
      "Classify the unit cube down to 2**depth voxels an edge, with respect to all half-spaces.\n\n"
      "Returns (tile_ijk, tile_log2, leaf_ijk, leaf_inside, leaf_boundary, n_inside, n_boundary); the\n"
      "counts are in voxels. With `count_only` the arrays stay empty.");
  m.def(
      "relaxed_cells",
      [](Array2<const double, 5> numbers, Array1<const Index> weights, Index n_domain, Index certain_before,
         Array1<const Index> ins, Array1<const Index> outs, Array<const Index, 2> k_before, int depth, int start_level,
         Array<const Index, 3> start, int stop_level, bool count_only, StopFlag* flag) {
        RelaxedCells found = without_lock(
            [&](Stop& stop) {
              const Index *k = k_before.data(), *ijk = start.data();
              return relaxed_cells({rows(numbers), span(weights), n_domain}, {span(ins), span(outs)}, depth,
                                   {certain_before, k[0], k[1], start_level, {ijk[0], ijk[1], ijk[2]}}, stop_level,
                                   count_only, stop);
            },
            flag);
        return std::make_tuple(to_rows<3>(std::move(found.tiles.ijk)), to_array(std::move(found.tiles.log2)),
                               to_array(std::move(found.tile_of)), to_rows<3>(std::move(found.leaves.ijk)),
                               to_array(std::move(found.leaf_of)), to_rows<8>(std::move(found.leaves.inside)),
                               to_rows<8>(std::move(found.leaves.boundary)), to_array(std::move(found.n_inside)),
                               to_array(std::move(found.n_boundary)), to_rows<9>(std::move(found.pending)),
                               to_rows<5>(std::move(found.pending_numbers)),
                               to_array(std::move(found.pending_weights)));
      },
      array("numbers"), array("weights"), nb::arg("n_domain"), nb::arg("certain_before"), array("ins"), array("outs"),
      array("k_before"), nb::arg("depth"), nb::arg("start_level"), array("start"), nb::arg("stop_level"),
      nb::arg("count_only"), stop_argument(),
      "Classify the unit cube, or one cell of it, down to 2**depth voxels an edge for every threshold.\n\n"
      "`numbers` are the planes of the cell `start` at `start_level`, with level -1 those of the cube before its\n"
      "root is looked at: normal, reach, value at the centre; the first `n_domain` are the domain's.\n"
      "`certain_before` is what the cell violates for certain, `k_before` the range of its unsettled thresholds.\n"
      "Cells still unsettled at `stop_level` are listed, not divided (none with stop_level >= depth).\n\n"
      "Returns (tile_ijk, tile_log2, tile_of, leaf_ijk, leaf_of, leaf_inside, leaf_boundary, n_inside, n_boundary,\n"
      "pending, pending_numbers, pending_weights): `*_of` is the threshold a row belongs to, counts are in voxels\n"
      "per threshold. A row of `pending` is a cell to go on with: ijk, first plane, first facet plane, end,\n"
      "certain weight, range of thresholds.");
  m.def(
      "add_open_weights",
      [](Array2<const double, 5> numbers, Array1<const Index> weights, int level, Array1<const Index> codes, int below,
         Array1<Index> sums, Array1<Index> bricks, StopFlag* flag) {
        without_lock(
            [&](Stop& stop) {
              add_open_weights({rows(numbers), span(weights), 0}, {level, span(codes)}, below, span(sums), span(bricks),
                               stop);
              return 0;
            },
            flag);
      },
      array("numbers"), array("weights"), nb::arg("level"), array("codes"), nb::arg("below"), array("sums"),
      array("bricks"), stop_argument(),
      "Add to `sums` what planes violate of open cells of the unit cube, and of their descendants.\n\n"
      "`numbers` are normal, reach, value at the centre of the cube. `codes` name open cells of `level`, ascending,\n"
      "three bits a level, x before y before z. `sums` has pairs (certain, possible): of each open cell, then of its\n"
      "descendants, level by level, down to `below`. Unless `bricks` is empty, the last of them are bricks of 8^3\n"
      "voxels, and 512 certain and 512 possible sums of each are added there; entry 64 z + 8 x + y.");
}

}  // namespace voxkernel
