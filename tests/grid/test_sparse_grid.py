import ast
import copy
import dataclasses
import pickle
from pathlib import Path

import numpy as np
import pytest
from grids import BOX, FULL, HIGH, LOW, check_valid, dense_mask, dense_values, random_grid
from hypothesis import given, settings
from hypothesis import strategies as st

from voxkernel.grid import SparseGrid, leaf_bits, morton
from voxkernel.grid import sparse_grid as grid_module

seeds = st.integers(0, 2**32)


# -- Morton codes and bits ----------------------------------------------------


def test_codes_round_trip_and_order_by_octant(rng):
    reach = morton.REACH >> 3
    leaf = rng.integers(-reach, reach, (1000, 3))
    leaf[:3] = [[-reach] * 3, [reach - 1] * 3, [0, -1, 1]]
    codes = morton.encode(leaf)
    np.testing.assert_array_equal(morton.decode(codes), leaf)
    assert codes.min() == 0
    assert codes.max() == 2**63 - 1
    cube = np.indices((2, 2, 2)).reshape(3, -1).T
    np.testing.assert_array_equal(np.diff(morton.encode(cube)), 1)


def test_parent_codes_are_codes_of_halved_coordinates(rng):
    leaf = rng.integers(-(1 << 20), 1 << 20, (1000, 3))
    np.testing.assert_array_equal(morton.parent_of(morton.encode(leaf)), morton.encode(leaf >> 1))


@given(st.lists(st.integers(0, 5000), min_size=0, max_size=20, unique=True).map(sorted))
def test_runs_are_cut_into_the_fewest_cells(ends):
    pairs = np.array(ends[: len(ends) // 2 * 2], dtype=np.int64).reshape(-1, 2)
    cut = morton.decompose(pairs[:, 0], pairs[:, 1])
    covered = [
        c for code, level in zip(cut.code, cut.level.tolist(), strict=True) for c in range(code, code + 8**level)
    ]
    assert sorted(covered) == [c for low, last in pairs for c in range(low, last + 1)]
    assert (cut.code % 8 ** cut.level.astype(np.int64) == 0).all()
    for row in range(len(pairs)):  # no eight siblings left unmerged
        mine = cut.owner == row
        parents = list(zip(cut.code[mine] >> 3 * (cut.level[mine] + 1), cut.level[mine], strict=True))
        assert all(parents.count(parent) < 8 for parent in set(parents))


def test_the_whole_range_is_eight_cells():
    cut = morton.decompose(np.array([0]), np.array([2**63 - 1]))
    assert cut.level.tolist() == [20] * 8
    np.testing.assert_array_equal(np.sort(cut.code), np.arange(8) << 60)


def test_masks_pack_as_word_x_bit_y8_z(rng):
    blocks = rng.random((5, 8, 8, 8)) < 0.3
    masks = leaf_bits.pack(blocks)
    np.testing.assert_array_equal(leaf_bits.unpack(masks), blocks)
    for leaf, x, y, z in rng.integers(0, (5, 8, 8, 8), (50, 4)).tolist():
        assert bool(int(masks[leaf, x]) >> (y * 8 + z) & 1) == blocks[leaf, x, y, z]
    np.testing.assert_array_equal(leaf_bits.popcount(masks), blocks.sum(axis=(1, 2, 3)))


def test_popcount_without_bitwise_count(monkeypatch, rng):
    masks = rng.integers(0, 2**64, (7, 8), dtype=np.uint64)
    expected = leaf_bits.popcount(masks)
    monkeypatch.delattr(np, "bitwise_count", raising=False)
    np.testing.assert_array_equal(leaf_bits.popcount(masks), expected)


# -- against dense arrays -------------------------------------------------------


@settings(max_examples=30)
@given(seeds)
def test_queries_agree_with_a_dense_array(seed):
    grid = random_grid(seed)
    dense = dense_mask(grid)
    np.testing.assert_array_equal(grid.to_dense(BOX), dense)
    assert grid.active_voxel_count == dense.sum()
    voxels = np.random.default_rng(seed).integers(LOW - 20, HIGH + 21, (500, 3))
    inside = ((voxels >= LOW) & (voxels <= HIGH)).all(axis=1)
    expected = np.zeros(500, dtype=bool)
    expected[inside] = dense[tuple((voxels[inside] - LOW).T)]
    np.testing.assert_array_equal(grid.is_active(voxels), expected)
    np.testing.assert_array_equal(grid.values_at(voxels), expected.astype(np.float32))
    listed = grid.to_ijk()
    again = np.zeros_like(dense)
    again[tuple((listed - LOW).T)] = True
    np.testing.assert_array_equal(again, dense)
    assert len(listed) == dense.sum()
    if not len(listed):
        assert grid.active_bbox is None
    else:
        np.testing.assert_array_equal(grid.active_bbox, [listed.min(axis=0), listed.max(axis=0)])


@pytest.mark.parametrize("seed", range(3))
def test_long_lists_are_answered_from_a_table(seed):
    grid = random_grid(seed, n_cells=40)
    voxels = np.random.default_rng(seed).integers(LOW - 9, HIGH + 10, (70_000, 3))
    voxels[:3] = [[2**40, 0, 0], [0, -(2**40), 0], [LOW, LOW, HIGH]]
    short = np.concatenate([grid.is_active(part) for part in np.array_split(voxels, 7)])
    assert grid._table is None
    for dtype in (np.int64, np.int32):
        chosen = voxels[3:].astype(dtype)
        np.testing.assert_array_equal(grid.is_active(chosen), short[3:])
    assert grid._table is not None
    np.testing.assert_array_equal(grid.is_active(voxels), short)
    np.testing.assert_array_equal(grid.points_in_grid(voxels + 0.5), short)
    np.testing.assert_array_equal(grid.is_active(voxels[:100]), short[:100])


@settings(max_examples=30)
@given(seeds, seeds)
def test_set_operations_agree_with_dense_arrays(seed_a, seed_b):
    a, b = random_grid(seed_a), random_grid(seed_b)
    dense_a, dense_b = dense_mask(a), dense_mask(b)
    for result, expected in (
        (a.union(b), dense_a | dense_b),
        (a.intersection(b), dense_a & dense_b),
        (a.difference(b), dense_a & ~dense_b),
    ):
        check_valid(result)
        np.testing.assert_array_equal(dense_mask(result), expected)


@settings(max_examples=30)
@given(seeds, seeds, st.floats(-1, 1, width=32))
def test_set_operations_of_values_keep_those_of_the_first(seed_a, seed_b, background):
    a = random_grid(seed_a, has_values=True, background=background)
    b = random_grid(seed_b, has_values=True)
    dense_a, dense_b = dense_mask(a), dense_mask(b)
    values_a, values_b = dense_values(a), dense_values(b)
    for result, active, values in (
        (a.union(b), dense_a | dense_b, np.where(dense_a, values_a, values_b)),
        (a.intersection(b), dense_a & dense_b, values_a),
        (a.difference(b), dense_a & ~dense_b, values_a),
    ):
        check_valid(result)
        np.testing.assert_array_equal(dense_mask(result), active)
        np.testing.assert_array_equal(dense_values(result)[active], values[active])
        assert result.background == a.background


@settings(max_examples=30)
@given(seeds, seeds)
def test_values_can_be_cut_with_a_mask_and_the_reverse(seed_a, seed_b):
    a, b = random_grid(seed_a, has_values=True), random_grid(seed_b)
    dense_a, dense_b = dense_mask(a), dense_mask(b)
    inner, outer = a.intersection(b), a.difference(b)
    np.testing.assert_array_equal(dense_mask(inner), dense_a & dense_b)
    np.testing.assert_array_equal(dense_values(outer)[dense_a & ~dense_b], dense_values(a)[dense_a & ~dense_b])
    assert b.intersection(a).is_mask
    np.testing.assert_array_equal(dense_mask(b.difference(a)), dense_b & ~dense_a)


@settings(max_examples=30)
@given(seeds, st.booleans())
def test_prune_is_the_smallest_and_only_form(seed, has_values):
    grid = random_grid(seed, has_values=has_values, n_cells=30)
    small = grid.prune()
    check_valid(small)
    assert small == grid
    np.testing.assert_array_equal(dense_mask(small), dense_mask(grid))
    again = small.prune()
    for name in ("tile_ijk", "tile_log2", "leaf_ijk", "leaf_mask", "tile_values", "leaf_values"):
        if getattr(small, name) is not None:
            np.testing.assert_array_equal(getattr(again, name), getattr(small, name))
    assert not (small.leaf_mask == 0).all(axis=1).any()
    if has_values:
        dense = np.where(dense_mask(grid), dense_values(grid), -5).astype(np.float32)
        other = SparseGrid.from_dense(dense, lower=[LOW] * 3, background=-5)
    else:
        other = SparseGrid.from_dense(dense_mask(grid), lower=[LOW] * 3)
    assert other == grid
    np.testing.assert_array_equal(other.tile_ijk, small.tile_ijk)
    np.testing.assert_array_equal(other.tile_log2, small.tile_log2)
    np.testing.assert_array_equal(other.leaf_mask, small.leaf_mask)


@settings(max_examples=30)
@given(seeds)
def test_coarsening_agrees_with_a_dense_array(seed):
    grid = random_grid(seed, has_values=True, n_cells=25)
    mask = SparseGrid.from_tiles_and_leaves(grid.tile_ijk, grid.tile_log2, grid.leaf_ijk, grid.leaf_mask)
    active, values = dense_mask(grid), dense_values(grid)
    blocks = active.reshape(32, 2, 32, 2, 32, 2)
    box = [[LOW // 2] * 3, [HIGH // 2] * 3]
    for rule, expected in (("any", blocks.any(axis=(1, 3, 5))), ("all", blocks.all(axis=(1, 3, 5)))):
        coarse = mask.coarsened(rule=rule)
        check_valid(coarse)
        np.testing.assert_array_equal(coarse.to_dense(box), expected)
        with_values = grid.coarsened(rule=rule)
        check_valid(with_values)
        sums = np.where(active, values, 0).reshape(blocks.shape).sum(axis=(1, 3, 5), dtype=np.float64)
        means = (sums / np.maximum(blocks.sum(axis=(1, 3, 5)), 1)).astype(np.float32)
        np.testing.assert_array_equal(with_values.to_dense(box)[expected], means[expected])
        assert with_values.active_voxel_count == expected.sum()
    np.testing.assert_array_equal(coarse.origin, mask.origin)
    np.testing.assert_array_equal(coarse.linear, 2 * mask.linear)


@settings(max_examples=30)
@given(seeds, st.booleans())
def test_voxel_lists_round_trip(seed, has_values):
    grid = random_grid(seed, has_values=has_values)
    voxels = np.random.default_rng(seed).permutation(grid.to_ijk())
    values = grid.values_at(voxels) if has_values else None
    again = SparseGrid.from_ijk(voxels, values=values)
    check_valid(again)
    assert again == grid


def test_distant_voxels_do_not_cost_memory():
    corners = np.array([[-(2**23)] * 3, [2**23 - 1] * 3, [2**23 - 1, -(2**23), 0]])
    grid = SparseGrid.from_ijk(np.repeat(corners, 2, axis=0))
    assert grid.active_voxel_count == 3
    assert grid.is_active(corners).all()
    np.testing.assert_array_equal(np.sort(grid.to_ijk(), axis=0), np.sort(corners, axis=0))
    assert grid.is_active([[2**31, 0, 0], [2**62, 5, -(2**62)], [0, 0, 0]]).tolist() == [False, False, False]
    assert grid.difference(grid).active_voxel_count == 0
    assert grid.coarsened().active_voxel_count == 3


def test_the_last_of_repeated_voxels_gives_the_value():
    grid = SparseGrid.from_ijk([[1, 2, 3], [0, 0, 0], [1, 2, 3]], values=[1, 2, 3], background=9)
    assert grid.values_at([[1, 2, 3], [0, 0, 0], [5, 5, 5]]).tolist() == [3, 2, 9]


# -- tiles against leaves at the same place ------------------------------------------


def leaf_grid(words, corner=(0, 0, 0)):
    return SparseGrid.from_tiles_and_leaves([], [], [corner], np.array([words], dtype=np.uint64))


def tile_grid(log2, corner=(0, 0, 0)):
    return SparseGrid.from_tiles_and_leaves([corner], [log2], [], [])


def test_a_full_leaf_equals_a_tile():
    assert leaf_grid([FULL] * 8) == tile_grid(3)
    assert leaf_grid([FULL] * 7 + [FULL - 1]) != tile_grid(3)
    assert tile_grid(3) != tile_grid(3, (8, 0, 0))


def test_a_tile_less_one_leaf_is_split_only_around_it():
    rest = tile_grid(10, (-1024, 0, 0)).difference(leaf_grid([1] + [0] * 7, (-8, 0, 0)))
    assert rest.active_voxel_count == 8**10 - 1
    assert rest.leaf_count == 1
    assert rest.tile_count == 7 * 7  # seven siblings on each of seven levels
    assert rest.union(leaf_grid([1] + [0] * 7, (-8, 0, 0))).prune().tile_count == 1


def test_union_of_a_tile_and_leaves_inside_it_is_the_tile():
    leaf = leaf_grid([5] * 8)
    for one, two in ((tile_grid(3), leaf), (leaf, tile_grid(3)), (tile_grid(6), leaf), (leaf, tile_grid(6))):
        assert one.union(two).leaf_count == 0
        assert one.union(two).tile_count == 1


def test_the_largest_tiles_meet_at_the_last_code():
    all_voxels = SparseGrid.from_tiles_and_leaves(
        (np.indices((2, 2, 2)).reshape(3, -1).T - 1) * 2**23, [23] * 8, [], []
    )
    assert all_voxels.active_voxel_count == 8**24
    top = leaf_grid([0] * 7 + [1 << 63], [2**23 - 8] * 3)
    less = all_voxels.difference(top)
    assert less.active_voxel_count == 8**24 - 1
    assert less.union(top) == all_voxels
    assert all_voxels.intersection(top) == top
    np.testing.assert_array_equal(all_voxels.active_bbox, [[-(2**23)] * 3, [2**23 - 1] * 3])
    assert all_voxels.coarsened().active_voxel_count == 8**23


def test_big_grids_stay_small_and_set_operations_do_not_expand_them(rng):
    corners = rng.permutation(np.indices((8, 8, 8)).reshape(3, -1).T)[:400] * 256 - 1024
    a = SparseGrid.from_tiles_and_leaves(corners, [8] * 400, [], [])
    b = SparseGrid.from_tiles_and_leaves(corners[:200] + np.array([128, 0, 0]), [7] * 200, [], [])
    assert a.active_voxel_count == 400 * 2**24  # 6.7e9 voxels
    assert a.nbytes == 400 * 13
    assert a.intersection(b).active_voxel_count == 200 * 2**21
    assert a.difference(b).active_voxel_count == 400 * 2**24 - 200 * 2**21
    with pytest.raises(ValueError, match=r"`max_voxels` must be at least the 6710886400 active voxels"):
        a.to_ijk()
    with pytest.raises(ValueError, match=r"`max_voxels` must be at least"):
        a.to_dense()


# -- values ----------------------------------------------------------------------


def test_nan_and_minus_zero_compare_as_values():
    nan = SparseGrid.from_ijk([[0, 0, 0]], values=[np.nan])
    signalling = SparseGrid.from_ijk([[0, 0, 0]], values=np.array([0x7F800001], np.uint32).view(np.float32))
    assert np.isnan(signalling.values_at([[0, 0, 0]])).all()
    assert nan == SparseGrid.from_ijk([[0, 0, 0]], values=[np.nan])
    assert SparseGrid.from_ijk([[0, 0, 0]], values=[-0.0]) == SparseGrid.from_ijk([[0, 0, 0]], values=[0.0])
    zeros = np.zeros((1, 512), dtype=np.float32)
    zeros[0, 7] = -0.0
    full = np.full((1, 8), FULL, dtype=np.uint64)
    grid = SparseGrid.from_tiles_and_leaves([], [], [[0, 0, 0]], full, tile_values=[], leaf_values=zeros)
    assert grid.prune().tile_count == 1


def test_equality_looks_at_voxels_values_and_transform_only():
    grid = SparseGrid.from_ijk([[0, 0, 0]], name="a")
    assert grid == SparseGrid.from_ijk([[0, 0, 0]], name="b")
    assert grid != SparseGrid.from_ijk([[0, 0, 0]], voxel_size=2)
    assert grid != SparseGrid.from_ijk([[0, 0, 0]], origin=(1, 0, 0))
    assert grid != SparseGrid.from_ijk([[0, 0, 0]], values=[1])
    assert SparseGrid.from_ijk([[0, 0, 0]], values=[2]) != SparseGrid.from_ijk([[0, 0, 0]], values=[1])
    assert grid != "grid"
    assert len({grid, SparseGrid.from_ijk([[0, 0, 0]], name="b"), SparseGrid.from_ijk([[0, 0, 1]])}) == 2


def test_inactive_tiles_are_values_without_activity():
    grid = dataclasses.replace(
        SparseGrid.from_ijk([[0, 0, 0]], values=[1], background=3),
        inactive_ijk=[[16, 0, 0], [8, 0, 0]],
        inactive_log2=[4, 3],
        inactive_values=[-3, -4],
    )
    points = [[0, 0, 0], [0, 0, 1], [8, 0, 0], [31, 15, 15], [32, 0, 0]]
    assert grid.values_at(points).tolist() == [1, 3, -4, -3, 3]
    assert grid.is_active(points).tolist() == [True, False, False, False, False]
    assert grid.to_dense([[0, 0, 0], [32, 0, 0]])[:, 0, 0].tolist() == [1] + [3] * 7 + [-4] * 8 + [-3] * 16 + [3]
    with pytest.raises(ValueError, match="must not overlap"):
        dataclasses.replace(grid, inactive_ijk=[[0, 0, 0], [16, 0, 0]], inactive_log2=[3, 4])
    alone = dataclasses.replace(
        SparseGrid.from_dense(np.zeros((1, 1, 1))), inactive_ijk=[[0, 0, 0]], inactive_log2=[3], inactive_values=[7]
    )
    assert alone.active_voxel_count == 0
    assert alone.values_at([[0, 0, 0]]) == 7
    with pytest.raises(ValueError, match="must not overlap"):
        dataclasses.replace(alone, inactive_ijk=[[0, 0, 0]] * 2, inactive_log2=[3, 4], inactive_values=[7, 8])
    with pytest.raises(ValueError, match="`inactive_ijk` must be empty in a mask"):
        dataclasses.replace(tile_grid(3), inactive_ijk=[[8, 0, 0]], inactive_log2=[3], inactive_values=[1])


# -- transforms --------------------------------------------------------------------


def test_index_and_world_follow_the_corner_convention(rng):
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    linear = turn * [0.5, 2.0, 1.0]
    grid = SparseGrid.from_ijk([[0, 0, 0], [-3, 4, 5]], origin=(1, 2, 3), linear=linear)
    ijk = rng.integers(-50, 50, (20, 3))
    xyz = grid.index_to_world(ijk)
    np.testing.assert_allclose(xyz, [np.array([1, 2, 3]) + linear @ (cell + 0.5) for cell in ijk], rtol=1e-13)
    np.testing.assert_allclose(grid.world_to_index(xyz), ijk, atol=1e-11)
    ones = np.column_stack([ijk, np.ones(20)])
    np.testing.assert_allclose((grid.transform @ ones.T).T[:, :3], xyz, rtol=1e-13)
    np.testing.assert_allclose(grid.index_to_world([[-0.5, -0.5, -0.5]]), [[1, 2, 3]])
    assert grid.points_in_grid(grid.index_to_world([[0, 0, 0], [-3, 4, 5], [1, 1, 1]])).tolist() == [
        True,
        True,
        False,
    ]
    assert grid.voxel_volume == pytest.approx(1.0)
    with pytest.raises(ValueError, match="`voxel_size` must be asked only of a uniform grid"):
        _ = grid.voxel_size


def test_points_on_faces_belong_to_the_upper_voxel():
    grid = SparseGrid.from_points([[0.5, 0.0, -0.5]], voxel_size=0.5)
    assert grid.to_ijk().tolist() == [[1, 0, -1]]
    assert grid.voxel_size == 0.5
    assert grid.points_in_grid([[0.5, 0, -0.5], [1.0, 0, -0.5], [1e300, 0, 0]]).tolist() == [
        True,
        False,
        False,
    ]


def test_grids_of_another_transform_are_refused():
    grid = SparseGrid.from_ijk([[0, 0, 0]], voxel_size=0.1)
    almost = SparseGrid.from_ijk([[0, 0, 0]], voxel_size=0.1 * (1 + 1e-12), origin=(1e-12, 0, 0))
    assert grid.intersection(almost).active_voxel_count == 1
    for other in (
        SparseGrid.from_ijk([[0, 0, 0]], voxel_size=0.2),
        SparseGrid.from_ijk([[0, 0, 0]], voxel_size=0.1, origin=(0.001, 0, 0)),
    ):
        with pytest.raises(ValueError, match="`other` must have the same transform"):
            grid.union(other)
    with pytest.raises(TypeError, match="`other` must be a SparseGrid; got list"):
        grid.union([])
    with pytest.raises(TypeError, match="`other` must be a mask like this grid"):
        grid.union(SparseGrid.from_ijk([[0, 0, 0]], voxel_size=0.1, values=[1]))


# -- the object ----------------------------------------------------------------------


def test_empty_grids_are_values():
    for empty in (
        SparseGrid.from_ijk([]),
        SparseGrid.from_points(np.zeros((0, 3))),
        SparseGrid.from_dense(np.zeros((3, 0, 2), dtype=bool)),
        SparseGrid.from_dense(np.zeros((9, 9, 9))),
        SparseGrid.from_tiles_and_leaves([], [], [], []),
    ):
        assert empty.active_voxel_count == 0
        assert empty.active_bbox is None
        assert empty.to_ijk().shape == (0, 3)
        assert empty.to_dense().shape == (0, 0, 0)
        assert empty.is_active([[0, 0, 0]]).tolist() == [False]
        assert empty.is_active([]).shape == (0,)
        assert empty == empty.prune()
        assert empty.coarsened(rule="all") == empty.coarsened()
        for result in (empty.union(empty), empty.intersection(empty), empty.difference(empty)):
            assert result == empty
    full = tile_grid(4)
    empty = SparseGrid.from_ijk([])
    assert full.union(empty) == empty.union(full) == full.difference(empty) == full
    assert full.intersection(empty) == empty.intersection(full) == empty.difference(full) == empty


def test_grids_pickle_copy_and_print():
    grid = SparseGrid.from_ijk([[0, 0, 0]], values=[2], name="v").union(SparseGrid.from_ijk([[9, 9, 9]], values=[1]))
    for again in (pickle.loads(pickle.dumps(grid)), copy.deepcopy(grid)):
        assert again == grid
        assert again.is_active([[9, 9, 9]]).all()
    assert repr(grid) == "SparseGrid('v', 2 active voxels, 0 tiles, 2 leaves, float)"
    assert repr(tile_grid(3)) == "SparseGrid('', 512 active voxels, 1 tile, 0 leaves, mask)"
    with pytest.raises(dataclasses.FrozenInstanceError):
        grid.name = "w"
    with pytest.raises(ValueError, match="read-only"):
        grid.leaf_mask[0] = 0


def test_sorted_arrays_are_shared_and_stay_writeable_for_their_owner():
    mask = np.ones((1, 8), dtype=np.uint64)
    grid = SparseGrid.from_tiles_and_leaves([], [], np.zeros((1, 3), np.int32), mask)
    assert np.shares_memory(grid.leaf_mask, mask)
    assert mask.flags.writeable


@pytest.mark.parametrize(
    ("changes", "error", "match"),
    [
        (
            {"tile_ijk": [[0.5, 0, 0]]},
            TypeError,
            "`tile_ijk` must be an array of integers; got dtype float64",
        ),
        ({"tile_ijk": [[0, 0]]}, ValueError, r"`tile_ijk` must have shape \(n, 3\); got \(1, 2\)"),
        ({"tile_ijk": [[8, 0, 0]]}, ValueError, r"`tile_ijk` must be a multiple of 16; got \[8, 0, 0\]"),
        ({"tile_ijk": [[2**23, 0, 0]]}, ValueError, "`tile_ijk` must be in -8388608..8388607"),
        ({"tile_log2": [2]}, ValueError, r"`tile_log2` must be in 3..23; got 2..2"),
        ({"tile_log2": [300]}, ValueError, "`tile_log2` must be in 3..23"),
        ({"tile_log2": [4, 4]}, ValueError, r"`tile_log2` must have shape \(1,\)"),
        ({"leaf_ijk": [[4, 0, 0]]}, ValueError, r"`leaf_ijk` must be multiples of 8; got \[4, 0, 0\]"),
        ({"leaf_mask": [[1] * 7]}, ValueError, r"`leaf_mask` must have shape \(1, 8\); got \(1, 7\)"),
        (
            {"leaf_mask": [[-1] * 8]},
            ValueError,
            "`leaf_mask` must be an array of uint64; got a negative number",
        ),
        ({"leaf_mask": [[0.5] * 8]}, TypeError, "`leaf_mask` must be an array of uint64; got dtype float64"),
        ({"leaf_ijk": [[8, 8, 8]]}, ValueError, "tiles and leaves must not overlap; got 1 overlapping pairs"),
        ({"tile_values": [1.0]}, ValueError, "`tile_values` and `leaf_values` must be given together"),
        ({"background": 1.0}, ValueError, "`background` must be 0 in a mask"),
        ({"linear": np.zeros((3, 3))}, ValueError, "`linear` must be an invertible matrix"),
        ({"linear": np.eye(2)}, ValueError, r"`linear` must have shape"),
        ({"origin": (0, 0)}, ValueError, r"`origin` must have shape \(3,\)"),
        ({"origin": (0, 0, np.nan)}, ValueError, "`origin` must be finite"),
        ({"voxel_size": 0}, ValueError, "`voxel_size` must be > 0; got 0"),
        ({"grid_class": "fog"}, ValueError, "`grid_class` must be one of"),
        ({"name": 3}, TypeError, "`name` must be a str; got int"),
    ],
)
def test_wrong_input_is_named(changes, error, match):
    arguments = {
        "tile_ijk": [[0, 0, 0]],
        "tile_log2": [4],
        "leaf_ijk": [[-8, 0, 0]],
        "leaf_mask": [[1] * 8],
    } | changes
    arrays = [arguments.pop(key) for key in ("tile_ijk", "tile_log2", "leaf_ijk", "leaf_mask")]
    with pytest.raises(error, match=match):
        SparseGrid.from_tiles_and_leaves(*arrays, **arguments)


def test_wrong_queries_are_named():
    grid = tile_grid(3)
    with pytest.raises(TypeError, match="`ijk` must be an array of integers"):
        grid.is_active([[0.0, 0, 0]])
    with pytest.raises(ValueError, match=r"`ijk` must have shape \(n, 3\); got \(3,\)"):
        grid.is_active([0, 0, 0])
    with pytest.raises(ValueError, match=r"`bbox` must have shape \(2, 3\)"):
        grid.to_dense([[0, 0, 0]])
    with pytest.raises(ValueError, match="`bbox` must have low <= high"):
        grid.to_dense([[5, 0, 0], [0, 0, 0]])
    with pytest.raises(ValueError, match="`rule` must be one of"):
        grid.coarsened(rule="some")
    with pytest.raises(ValueError, match=r"`array` must be bool or real \(nx, ny, nz\)"):
        SparseGrid.from_dense(np.zeros((2, 2)))
    with pytest.raises(ValueError, match="`array` must end below voxel"):
        SparseGrid.from_dense(np.zeros((2, 2, 2)), lower=(2**23 - 1, 0, 0))
    with pytest.raises(ValueError, match="`xyz` must lie within"):
        SparseGrid.from_points([[1e9, 0, 0]])
    with pytest.raises(ValueError, match=r"`values` must have shape \(1,\); got \(2,\)"):
        SparseGrid.from_ijk([[0, 0, 0]], values=[1, 2])


def test_the_grid_imports_numpy_only_and_no_geometry():
    package = Path(grid_module.__file__).parent
    for name in (
        "sparse_grid", "build", "query", "set_operations", "cell_runs", "morton", "leaf_bits", "blocks",
        "array_checks", "lookup",
    ):
        for node in ast.walk(ast.parse((package / f"{name}.py").read_text())):
            if isinstance(node, ast.Import):
                assert {alias.name for alias in node.names} <= {"numpy"}
            elif isinstance(node, ast.ImportFrom):
                allowed = ("__future__", "numpy", "voxkernel", "collections.abc", "dataclasses", "types", "typing")
                assert node.module.startswith(allowed), node.module
                if node.module == "voxkernel._core":
                    assert {a.name.rpartition("_in_")[0] for a in node.names} == {"voxels", "points"}
                elif node.module.startswith("voxkernel."):
                    assert node.module.split(".")[1] in {"_checks", "_frozen", "grid"}
