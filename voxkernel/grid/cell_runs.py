"""Set operations on tiles and leaves as sorted Morton runs: no tile is ever expanded to voxels."""

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel.grid.leaf_bits import FULL, halve, unpack
from voxkernel.grid.morton import Cut, count_up, decompose, last_of, parent_of

__all__ = [
    "Body",
    "Cells",
    "canonical",
    "cells_of",
    "coarsen",
    "difference",
    "intersection",
    "merged",
    "union",
]


class Cells(NamedTuple):
    """Tiles and leaves together, sorted by code; `row` is a leaf's row, or ``~row`` of a tile."""

    code: NDArray[np.int64]
    last: NDArray[np.int64]
    row: NDArray[np.int64]

    def with_runs(self, code: NDArray[np.int64], last: NDArray[np.int64]) -> "Cells":
        """These cells and further runs, sorted; the row of a further run is -1."""
        all_code = np.concatenate([self.code, code])
        order = np.argsort(all_code, kind="stable")
        all_row = np.concatenate([self.row, np.full(len(code), -1)])
        return Cells(all_code[order], np.concatenate([self.last, last])[order], all_row[order])


class Body(NamedTuple):
    """What a grid holds, without its transform; values are None in a mask."""

    tile_code: NDArray[np.int64]
    tile_log2: NDArray[np.int8]
    tile_values: NDArray[np.float32] | None
    leaf_code: NDArray[np.int64]
    leaf_mask: NDArray[np.uint64]
    leaf_values: NDArray[np.float32] | None


class Canonical(NamedTuple):
    """Longest runs of one value, and the leaves that are not one value: equal for equal sets."""

    code: NDArray[np.int64]
    last: NDArray[np.int64]
    values: NDArray[np.float32] | None
    leaf_code: NDArray[np.int64]
    leaf_mask: NDArray[np.uint64]
    leaf_values: NDArray[np.float32] | None


def cells_of(body: Body) -> Cells:
    """Merge tiles and leaves into one sorted list (the stable sort of two sorted parts is a merge)."""
    code = np.concatenate([body.tile_code, body.leaf_code])
    last = np.concatenate([last_of(body.tile_code, body.tile_log2 - 3), body.leaf_code])
    row = np.concatenate([~np.arange(len(body.tile_code)), np.arange(len(body.leaf_code))])
    order = np.argsort(code, kind="stable")
    return Cells(code[order], last[order], row[order])


def _holders(inner: Cells, outer: Cells) -> NDArray[np.int64]:
    """For each cell of `inner` the index of the cell of `outer` that holds it, -1 if none does."""
    if not len(outer.code):
        return np.full(len(inner.code), -1, dtype=np.int64)
    place = np.searchsorted(outer.code, inner.code, side="right") - 1
    return np.where((place >= 0) & (inner.last <= outer.last[place]), place, -1)


def _is_same(inner: Cells, outer: Cells, holder: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether a cell's holder is no larger than the cell itself."""
    same = holder >= 0
    held = holder[same]
    same[same] = (inner.code[same] == outer.code[held]) & (inner.last[same] == outer.last[held])
    return same


def _masks(body: Body, rows: NDArray[np.int64]) -> NDArray[np.uint64]:
    """Masks of cells; an 8^3 piece of a tile is full."""
    masks = np.full((len(rows), 8), FULL)
    is_leaf = rows >= 0
    masks[is_leaf] = body.leaf_mask[rows[is_leaf]]
    return masks


def _values(body: Body, rows: NDArray[np.int64]) -> NDArray[np.float32] | None:
    """Values (n, 512) of cells; an 8^3 piece of a tile repeats the value of the tile."""
    if body.leaf_values is None or body.tile_values is None:
        return None
    values = np.empty((len(rows), 512), dtype=np.float32)
    is_leaf = rows >= 0
    values[is_leaf] = body.leaf_values[rows[is_leaf]]
    values[~is_leaf] = body.tile_values[~rows[~is_leaf]][:, None]
    return values


def _taken(values: NDArray[np.float32] | None, rows: NDArray[np.int64]) -> NDArray[np.float32] | None:
    return None if values is None else values[rows]


def _joined(*parts: NDArray[np.float32] | None) -> NDArray[np.float32] | None:
    present = [part for part in parts if part is not None]
    return np.concatenate(present) if present else None


def _log2_of(code: NDArray[np.int64], last: NDArray[np.int64]) -> NDArray[np.int8]:
    """Edge of cells from their runs: a run has 8**level codes."""
    exponent = np.frexp((last - code + 1).astype(np.float64))[1] - 1
    return (exponent // 3 + 3).astype(np.int8)


def _sorted(body: Body, *, drop_empty: bool = True) -> Body:
    """Put the parts of a result in order; leaves in which nothing is left are dropped."""
    tiles = np.argsort(body.tile_code, kind="stable")
    leaves = np.arange(len(body.leaf_code))
    if drop_empty:
        leaves = np.flatnonzero(body.leaf_mask.any(axis=1))
    leaves = leaves[np.argsort(body.leaf_code[leaves], kind="stable")]
    return Body(
        body.tile_code[tiles],
        body.tile_log2[tiles],
        _taken(body.tile_values, tiles),
        body.leaf_code[leaves],
        body.leaf_mask[leaves],
        _taken(body.leaf_values, leaves),
    )


def intersection(a: Body, b: Body, cells_a: Cells, cells_b: Cells) -> Body:
    """Voxels in both, with the values of `a`: of two nested cells the smaller one is what they share."""
    over = _holders(cells_a, cells_b)
    under = _holders(cells_b, cells_a)
    same = _is_same(cells_b, cells_a, under)
    small_a = np.flatnonzero(over >= 0)
    small_b = np.flatnonzero((under >= 0) & ~same)
    code = np.concatenate([cells_a.code[small_a], cells_b.code[small_b]])
    last = np.concatenate([cells_a.last[small_a], cells_b.last[small_b]])
    row_a = np.concatenate([cells_a.row[small_a], cells_a.row[under[small_b]]])
    row_b = np.concatenate([cells_b.row[over[small_a]], cells_b.row[small_b]])
    is_tile = (row_a < 0) & (row_b < 0)
    tiles, leaves = np.flatnonzero(is_tile), np.flatnonzero(~is_tile)
    return _sorted(
        Body(
            code[tiles],
            _log2_of(code[tiles], last[tiles]),
            _taken(a.tile_values, ~row_a[tiles]),
            code[leaves],
            _masks(a, row_a[leaves]) & _masks(b, row_b[leaves]),
            _values(a, row_a[leaves]),
        )
    )


def difference(a: Body, b: Body, cells_a: Cells, cells_b: Cells) -> Body:
    """Voxels of `a` that are not in `b`; a tile of `a` is cut only around the cells of `b` inside it."""
    over = _holders(cells_a, cells_b)
    first = np.searchsorted(cells_b.code, cells_a.code, side="left")
    n_inside = np.searchsorted(cells_b.code, cells_a.last, side="right") - first
    whole = np.flatnonzero((over < 0) & (n_inside == 0))
    paired = np.flatnonzero(over >= 0)
    paired = paired[cells_b.row[over[paired]] >= 0]
    cut = np.flatnonzero((over < 0) & (n_inside > 0))

    holes = np.repeat(first[cut], n_inside[cut]) + count_up(n_inside[cut])
    owners = np.repeat(cut, n_inside[cut])
    gaps = _gaps(cells_a, cells_b, owners, holes)
    bitten = cells_b.row[holes] >= 0
    bitten_rows = cells_a.row[owners[bitten]]

    whole_rows = cells_a.row[whole]
    whole_tiles, whole_leaves = ~whole_rows[whole_rows < 0], whole_rows[whole_rows >= 0]
    paired_rows = cells_a.row[paired]
    gap_rows = ~cells_a.row[gaps.owner]
    return _sorted(
        Body(
            np.concatenate([a.tile_code[whole_tiles], gaps.code]),
            np.concatenate([a.tile_log2[whole_tiles], gaps.level + np.int8(3)]),
            _joined(_taken(a.tile_values, whole_tiles), _taken(a.tile_values, gap_rows)),
            np.concatenate([a.leaf_code[whole_leaves], cells_a.code[paired], cells_b.code[holes[bitten]]]),
            np.concatenate(
                [
                    a.leaf_mask[whole_leaves],
                    _masks(a, paired_rows) & ~b.leaf_mask[cells_b.row[over[paired]]],
                    ~b.leaf_mask[cells_b.row[holes[bitten]]],
                ]
            ),
            _joined(_taken(a.leaf_values, whole_leaves), _values(a, paired_rows), _values(a, bitten_rows)),
        )
    )


def _gaps(cells_a: Cells, cells_b: Cells, owners: NDArray[np.int64], holes: NDArray[np.int64]) -> Cut:
    """What is left of the tiles `owners` of `a` between the cells `holes` of `b`, as octree cells."""
    if not len(owners):
        return decompose(np.zeros(0, np.int64), np.zeros(0, np.int64))
    is_first = np.ones(len(owners), dtype=np.bool_)
    is_first[1:] = owners[1:] != owners[:-1]
    is_last = np.roll(is_first, -1)
    before = np.where(is_first, cells_a.code[owners] - 1, cells_b.last[holes - 1])
    ahead = np.flatnonzero(before + 1 < cells_b.code[holes])
    behind = np.flatnonzero(is_last & (cells_b.last[holes] < cells_a.last[owners]))
    cut = decompose(
        np.concatenate([before[ahead] + 1, cells_b.last[holes[behind]] + 1]),
        np.concatenate([cells_b.code[holes[ahead]] - 1, cells_a.last[owners[behind]]]),
    )
    return Cut(cut.code, cut.level, np.concatenate([owners[ahead], owners[behind]])[cut.owner])


def union(a: Body, b: Body, cells_a: Cells, cells_b: Cells) -> Body:
    """Voxels of either; where both are active the values of `a` hold."""
    if a.leaf_values is not None:
        return _stacked(a, difference(b, a, cells_b, cells_a))
    over, under = _holders(cells_a, cells_b), _holders(cells_b, cells_a)
    is_leaf_b = np.zeros(len(over), dtype=np.bool_)
    is_leaf_b[over >= 0] = cells_b.row[over[over >= 0]] >= 0
    keep_a = cells_a.row[(over < 0) | (is_leaf_b & (cells_a.row < 0))]
    pairs = np.flatnonzero(is_leaf_b & (cells_a.row >= 0))
    same = _is_same(cells_b, cells_a, under)
    keep_b = cells_b.row[(under < 0) | (same & (cells_b.row < 0))]
    rows_a, rows_b = cells_a.row[pairs], cells_b.row[over[pairs]]
    tiles_a, tiles_b = ~keep_a[keep_a < 0], ~keep_b[keep_b < 0]
    leaves_a, leaves_b = keep_a[keep_a >= 0], keep_b[keep_b >= 0]
    return _sorted(
        Body(
            np.concatenate([a.tile_code[tiles_a], b.tile_code[tiles_b]]),
            np.concatenate([a.tile_log2[tiles_a], b.tile_log2[tiles_b]]),
            None,
            np.concatenate([a.leaf_code[leaves_a], b.leaf_code[leaves_b], a.leaf_code[rows_a]]),
            np.concatenate([a.leaf_mask[leaves_a], b.leaf_mask[leaves_b], a.leaf_mask[rows_a] | b.leaf_mask[rows_b]]),
            None,
        )
    )


def _stacked(a: Body, rest: Body) -> Body:
    """Join float grids that share no voxel, though they may share a leaf."""
    if a.leaf_values is None or rest.leaf_values is None:
        raise TypeError("`a` and `rest` must hold values; got a mask")
    leaf_mask, leaf_values = a.leaf_mask.copy(), a.leaf_values.copy()
    place = np.searchsorted(a.leaf_code, rest.leaf_code)
    clipped = np.minimum(place, len(a.leaf_code) - 1)
    shared = np.zeros(len(rest.leaf_code), dtype=np.bool_)
    if len(a.leaf_code):
        shared = a.leaf_code[clipped] == rest.leaf_code
    rows = clipped[shared]
    bits = unpack(rest.leaf_mask[shared]).reshape(-1, 512)
    leaf_values[rows] = np.where(bits, rest.leaf_values[shared], leaf_values[rows])
    leaf_mask[rows] |= rest.leaf_mask[shared]
    new = np.flatnonzero(~shared)
    return _sorted(
        Body(
            np.concatenate([a.tile_code, rest.tile_code]),
            np.concatenate([a.tile_log2, rest.tile_log2]),
            _joined(a.tile_values, rest.tile_values),
            np.concatenate([a.leaf_code, rest.leaf_code[new]]),
            np.concatenate([leaf_mask, rest.leaf_mask[new]]),
            np.concatenate([leaf_values, rest.leaf_values[new]]),
        )
    )


def canonical(body: Body) -> Canonical:
    """The one form that all ways of splitting the same set share; inactive voxels of leaves read 0."""
    solid = (body.leaf_mask == FULL).all(axis=1)
    run_values: NDArray[np.float32] | None = None
    if body.leaf_values is not None and body.tile_values is not None:
        with np.errstate(invalid="ignore"):  # signalling NaN
            bits = (body.leaf_values + np.float32(0)).view(np.int32)  # adding 0 turns -0 into 0
            solid &= (bits == bits[:, :1]).all(axis=1)
            run_values = np.concatenate([body.tile_values, body.leaf_values[solid, 0]]) + np.float32(0)
    code = np.concatenate([body.tile_code, body.leaf_code[solid]])
    last = np.concatenate([last_of(body.tile_code, body.tile_log2 - 3), body.leaf_code[solid]])
    order = np.argsort(code, kind="stable")
    code, last = code[order], last[order]
    is_start = np.ones(len(code), dtype=np.bool_)
    is_start[1:] = code[1:] != last[:-1] + 1
    if run_values is not None:
        run_values = run_values[order]
        run_bits = run_values.view(np.int32)
        is_start[1:] |= run_bits[1:] != run_bits[:-1]
        run_values = run_values[is_start]
    starts = np.flatnonzero(is_start)
    ends = np.append(starts[1:], len(code)) - 1 if len(starts) else starts
    rest = np.flatnonzero(~solid & body.leaf_mask.any(axis=1))
    leaf_values = _taken(body.leaf_values, rest)
    if leaf_values is not None:
        leaf_values = np.where(unpack(body.leaf_mask[rest]).reshape(-1, 512), leaf_values, np.float32(0))
    return Canonical(code[starts], last[ends], run_values, body.leaf_code[rest], body.leaf_mask[rest], leaf_values)


def merged(body: Body) -> Body:
    """The fewest tiles and leaves that hold the same active voxels and values."""
    form = canonical(body)
    cut = decompose(form.code, form.last)
    rest = np.searchsorted(body.leaf_code, form.leaf_code)
    return _sorted(
        Body(
            cut.code,
            cut.level + np.int8(3),
            _taken(form.values, cut.owner),
            form.leaf_code,
            form.leaf_mask,
            _taken(body.leaf_values, rest),
        )
    )


def coarsen(body: Body, rule: Literal["any", "all"]) -> Body:
    """Merge 2^3 voxels into one; float values become the mean of the active ones."""
    is_small = body.tile_log2 == 3
    small = np.flatnonzero(is_small)
    code = np.concatenate([body.tile_code[small], body.leaf_code])
    rows = np.concatenate([~small, np.arange(len(body.leaf_code))])
    order = np.argsort(code, kind="stable")
    code, rows = code[order], rows[order]
    masks = halve(_masks(body, rows), code & 7, rule)
    starts = np.flatnonzero(np.diff(code >> 3, prepend=-1))
    leaf_mask = np.bitwise_or.reduceat(masks, starts, axis=0) if len(starts) else masks
    large = ~is_small
    return _sorted(
        Body(
            parent_of(body.tile_code[large]),
            body.tile_log2[large] - np.int8(1),
            None if body.tile_values is None else body.tile_values[large],
            parent_of(code[starts]),
            leaf_mask,
            _coarse_values(body, code, rows, starts),
        )
    )


def _coarse_values(
    body: Body, code: NDArray[np.int64], rows: NDArray[np.int64], starts: NDArray[np.int64]
) -> NDArray[np.float32] | None:
    """Mean of the active values of 2^3 voxels, in leaves of the coarse grid (0 where none is active)."""
    values = _values(body, rows)
    if values is None:
        return None
    bits = unpack(_masks(body, rows)).reshape(-1, 4, 2, 4, 2, 4, 2)
    sums = np.where(bits, values.reshape(bits.shape), 0).sum(axis=(2, 4, 6), dtype=np.float64)
    counts = bits.sum(axis=(2, 4, 6))
    means = (sums / np.maximum(counts, 1)).astype(np.float32)
    coarse = np.zeros((len(starts), 2, 4, 2, 4, 2, 4), dtype=np.float32)
    owner = np.repeat(np.arange(len(starts)), np.diff(np.append(starts, len(code))))
    octant = code & 7
    coarse[owner, octant >> 2, :, (octant >> 1) & 1, :, octant & 1, :] = means
    return coarse.reshape(-1, 512)
