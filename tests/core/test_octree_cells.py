"""The octrees, the centre search and the field next to integers: planes a . u <= d / 8 over the unit cube."""


import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from voxkernel._core import add_open_weights, exact_cells, least_violated, relaxed_cells, violation_cells

plane_rows = st.lists(
    st.tuples(st.integers(-3, 3), st.integers(-3, 3), st.integers(-3, 3), st.integers(1, 9)).filter(
        lambda row: any(row[:3])
    ),
    max_size=5,
)
UNITS = 1 << 60


def unit_planes(rows):
    """Normals of length 1 and offsets of integer rows (a, b, c, d)."""
    normals, offsets = np.array([r[:3] for r in rows], float).reshape(-1, 3), np.array([r[3] / 8 for r in rows])
    lengths = np.linalg.norm(normals, axis=1)
    return normals / lengths[:, None], offsets / lengths


def least_of_cube(normals, offsets, pads, weights, n_border, *search, threads=1):
    """`least_violated` of planes that are in the unit cube already, the first of them those of a domain."""
    n = n_border
    in_the_cube = np.array([1.0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 0])
    arrays = normals[n:], offsets[n:], pads[n:], weights[n:], in_the_cube, normals[:n], offsets[:n], pads[:n]
    return least_violated(*arrays, *search[:-2], threads, *search[-2:])


def reach_of(normals):
    return np.abs(normals).sum(axis=1)


def corner_signs(rows, depth):
    """Smallest and largest value of 8 (a . u) - d at the corners of every voxel, times its count: integers."""
    size = 2**depth
    grid = np.stack(np.meshgrid(*[np.arange(size + 1)] * 3, indexing="ij"), -1)
    for a, b, c, d in rows:
        side = 8 * (grid @ np.array([a, b, c])) - d * size
        corners = np.stack([side[i : i + size, j : j + size, k : k + size] for i, j, k in np.ndindex(2, 2, 2)])
        yield corners.min(0), corners.max(0), (corners == 0).any(0)


def verdicts(depth, tile_ijk, tile_log2, leaf_ijk, leaf_inside, leaf_boundary):
    """1 inside, 0 undecided, -1 outside for every voxel; each is told at most once."""
    size = 2**depth
    verdict = np.full((size,) * 3, -1)
    for (x, y, z), log2 in zip(tile_ijk, tile_log2, strict=True):
        e = 2 ** int(log2)
        assert (verdict[x : x + e, y : y + e, z : z + e] == -1).all()
        verdict[x : x + e, y : y + e, z : z + e] = 1
    for (x, y, z), ins, bou in zip(leaf_ijk, leaf_inside, leaf_boundary, strict=True):
        for masks, value in ((ins, 1), (bou, 0)):
            bits = np.unpackbits(np.ascontiguousarray(masks).view(np.uint8), bitorder="little").reshape(8, 8, 8)
            verdict[x : x + 8, y : y + 8, z : z + 8][bits == 1] = value
    return verdict


@given(plane_rows, st.integers(3, 4))
def test_exact_cells(rows, depth):
    """Every voxel is inside, outside or undecided as its corners say."""
    normals, offsets = unit_planes(rows)
    *arrays, n_inside, n_boundary = exact_cells(
        normals, offsets, reach_of(normals), np.full(len(rows), 1e-14), depth, False
    )
    verdict = verdicts(depth, *arrays)
    assert (verdict == 1).sum() == n_inside
    assert (verdict == 0).sum() == n_boundary
    inside = np.ones(verdict.shape, bool)
    outside, touching = ~inside, ~inside  # a corner exactly on a plane may stay undecided
    for low, high, touch in corner_signs(rows, depth):
        inside, outside, touching = inside & (high <= 0), outside | (low > 0), touching | touch
    assert inside[verdict == 1].all()
    assert not (inside & (verdict == -1)).any()
    assert (verdict[inside & ~touching] == 1).all()
    assert (verdict[outside] < 1).all()
    assert (verdict[outside & ~touching] == -1).all()


def run_relaxed(rows, weights, n_domain, depth, ins, outs, *, start=None, stop=99, count_only=False):
    normals, offsets = unit_planes(rows)
    numbers = np.column_stack([normals, reach_of(normals) * (1 + 1e-13), 0.5 * normals.sum(axis=1) - offsets])
    return relaxed_cells(
        numbers, weights, n_domain, 0, ins, outs, np.array([0, len(ins)]), depth, -1, np.zeros(3, np.int64), stop,
        count_only,
    )  # fmt: skip


@given(plane_rows, plane_rows, st.lists(st.integers(1, 9), min_size=10, max_size=10), st.integers(3, 4), st.data())
def test_relaxed_cells(domain, rows, weights, depth, data):
    """What a voxel violates for certain and at most is what the integers say, at every threshold."""
    weights = np.array([1] * len(domain) + weights[: len(rows)], np.int64)
    bounds = np.array(sorted(data.draw(st.lists(st.integers(0, 40), min_size=1, max_size=3))), np.int64)
    found = run_relaxed([*domain, *rows], weights, len(domain), depth, bounds, bounds)
    tile_ijk, tile_log2, tile_of, leaf_ijk, leaf_of, leaf_inside, leaf_boundary, n_inside, n_boundary = found[:9]
    shape = (2**depth,) * 3
    certain, possible = np.zeros(shape, int), np.zeros(shape, int)
    beyond, within, touching = np.zeros(shape, bool), np.ones(shape, bool), np.zeros(shape, bool)
    for i, (low, high, touch) in enumerate(corner_signs([*domain, *rows], depth)):
        touching |= touch
        if i < len(domain):
            beyond, within = beyond | (low > 0), within & (high <= 0)
        else:
            certain += np.where(low > 0, weights[i], 0)
            possible += np.where(high > 0, weights[i], 0)
    for k, most in enumerate(bounds):
        t, f = tile_of == k, leaf_of == k
        verdict = verdicts(depth, tile_ijk[t], tile_log2[t], leaf_ijk[f], leaf_inside[f], leaf_boundary[f])
        assert (verdict == 1).sum() == n_inside[k]
        assert (verdict == 0).sum() == n_boundary[k]
        inside, outside = within & (possible <= most), beyond | (certain > most)
        assert inside[verdict == 1].all()
        assert outside[(verdict == -1) & ~touching].all()
        assert (verdict[inside & ~touching] == 1).all()
        assert (verdict[outside & ~touching] == -1).all()
        assert (verdict[outside] < 1).all()
    counted = run_relaxed([*domain, *rows], weights, len(domain), depth, bounds, bounds, count_only=True)
    assert (counted[7] == n_inside).all()
    assert (counted[8] == n_boundary).all()


def many_planes(n, seed=5):
    """Integer planes about the middle of the cube, more than a list is looked at in one piece."""
    rng = np.random.default_rng(seed)
    rows = [r for r in rng.integers(-9, 10, (n, 3)).tolist() if any(r)]
    return [(a, b, c, 4 * (a + b + c) + int(e)) for (a, b, c), e in zip(rows, rng.integers(0, 30, n), strict=False)]


def test_cells_that_are_continued_are_those_of_one_run():
    rows = many_planes(1500)
    weights = np.ones(len(rows), np.int64)
    bounds = np.array([150, 400], np.int64)
    whole = run_relaxed(rows, weights, 0, 5, bounds, bounds)
    top = run_relaxed(rows, weights, 0, 5, bounds, bounds, stop=1)
    *_, pending, listed, listed_weights = top
    assert len(pending) > 1
    counts = [top[7:9]]
    for row in pending:
        first, middle, end, certain = row[3:7].tolist()
        args = listed[first:end], listed_weights[first:end], middle - first, certain, bounds, bounds, row[7:], 5, 1
        counts.append(relaxed_cells(*args, row[:3], 99, False)[7:9])
    assert (np.sum(counts, axis=0) == whole[7:9]).all()


def dense_violation(rows, weights, depth):
    """Integer weights violated at voxel centres."""
    size = 2**depth
    grid = np.stack(np.meshgrid(*[2 * np.arange(size) + 1] * 3, indexing="ij"), -1)
    return sum(w * (4 * (grid @ np.array(r[:3])) - r[3] * size > 0) for r, w in zip(rows, weights, strict=True))


@pytest.mark.parametrize("most", [0, 100, 300, 2000])
def test_violation_cells(most):
    """Values at voxel centres are those of a sweep; planes at odd sixteenths of a voxel meet no centre."""
    depth = 4
    rows = [(a, b, c, d + 1.0 / 3.0) for a, b, c, d in many_planes(900)]
    weights = np.random.default_rng(1).integers(1, 5, len(rows))
    normals, offsets = unit_planes(rows)
    expected = dense_violation(rows, weights, depth)
    tile_ijk, tile_log2, tile_values, leaf_ijk, leaf_mask, leaf_values = violation_cells(
        normals, offsets, reach_of(normals) * (1 + 1e-13), weights, 0, most, 1.0, depth
    )
    active = np.zeros(expected.shape, bool)
    for (x, y, z), log2, value in zip(tile_ijk, tile_log2, tile_values, strict=True):
        cube = tuple(slice(v, v + 2 ** int(log2)) for v in (x, y, z))
        active[cube] = True
        assert (expected[cube] == value).all()
    for (x, y, z), mask, values in zip(leaf_ijk, leaf_mask, leaf_values, strict=True):
        cube = tuple(slice(v, v + 8) for v in (x, y, z))
        assert (expected[cube] == values.reshape(8, 8, 8)).all()
        active[cube] = np.unpackbits(mask.view(np.uint8), bitorder="little").reshape(8, 8, 8)
    assert (active == (expected <= most)).all()


@pytest.mark.parametrize("n", [3, 40, 1200])
def test_least_violated(n):
    """No sample of the cube violates less than the lower bound; the centre violates what is said."""
    rows = [(a, b, c, d - 25) for a, b, c, d in many_planes(n)]
    normals, offsets = unit_planes(rows)
    weights = np.full(len(rows), UNITS // len(rows))
    center, cell = np.full(3, np.nan), np.full(4, np.nan)
    pads = np.full(len(rows), 1e-14)
    best, lower, n_cells, _ = least_of_cube(
        normals, offsets, pads, weights, 0, 1e-15, UNITS, UNITS // 100, 0.0, 10, 10**6, center, cell
    )
    assert 0 <= lower <= best <= UNITS
    assert n_cells > 0
    assert lower <= dense_violation(rows, np.ones(len(rows), int), 5).min() * (UNITS // len(rows))
    assert weights[normals @ center - offsets > 0].sum() == best
    assert best - lower <= UNITS // 100 or not np.isnan(cell).any()


def test_least_violated_visits_the_best_cells_first():
    """More cells never loosen the lower bound; few prove more than all cells of a level do, of which there are more."""
    rows = [(a, b, c, d - 25) for a, b, c, d in many_planes(1200)]
    normals, offsets = unit_planes(rows)
    pads, weights = np.full(len(rows), 1e-14), np.ones(len(rows), np.int64)
    found = [
        least_of_cube(
            normals, offsets, pads, weights, 0, 1e-15, len(rows), 1, 0.0, 10, most, np.empty(3), np.empty(4)
        )
        for most in (9, 99, 999, 4000, 10**7)
    ]
    lower = [low for _, low, *_ in found]
    assert lower == sorted(lower)
    assert lower[-1] <= min(best for best, *_ in found)
    assert [is_over for *_, is_over in found] == [True] * 4 + [False]
    centers = (np.stack(np.indices((16,) * 3), axis=-1).reshape(-1, 3) + 0.5) / 16
    sure = (centers @ normals.T - offsets > reach_of(normals) / 32).sum(axis=1)
    assert lower[3] > sure.min()


def _long_lists(seed, n=20_000):
    """More planes than a list of planes holds at first, about a point off the middle, some of them of a domain."""
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(n, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    offsets = normals @ [0.4, 0.55, 0.6] + 0.15 * rng.normal(size=n) + 0.1
    offsets[:6] = normals[:6] @ np.full(3, 0.5) + 0.3
    return normals, offsets, np.full(n, 1e-14), rng.integers(1, 1000, n)


@pytest.mark.parametrize("most", [40, 2000, 10**6])
def test_least_violated_does_not_depend_on_threads(most):
    """All bits are the same, also where the cap on cells ends the search in the middle of a round."""
    arrays = _long_lists(3)
    total = int(arrays[3].sum())
    found = []
    for threads in (1, 2, 3, 5):
        center, cell = np.full(3, np.nan), np.full(4, np.nan)
        best = least_of_cube(
            *arrays, 6, 1e-15, total, total // 200, 0.0, 9, most, center, cell, threads=threads
        )
        found.append((best, center.tobytes(), cell.tobytes()))
    assert found == found[:1] * 4


def test_least_violated_of_long_lists():
    """Lists of numbers, of which each plane is counted once: no sample is below the bound, the centre is as said."""
    normals, offsets, pads, weights = _long_lists(4)
    center, cell = np.full(3, np.nan), np.full(4, np.nan)
    total = int(weights[6:].sum())
    best, lower, _, is_over = least_of_cube(
        normals, offsets, pads, weights, 6, 1e-15, total, total // 1000, 0.0, 12, 10**6, center, cell
    )
    assert not is_over
    assert best - lower <= total // 1000
    assert weights[6:][normals[6:] @ center - offsets[6:] > 0].sum() == best
    rng = np.random.default_rng(0)
    points = np.concatenate([rng.random((400, 3)), center + 0.01 * (rng.random((400, 3)) - 0.5)])
    points = points[(points @ normals[:6].T <= offsets[:6]).all(axis=1)]
    assert len(points) > 400
    assert ((points @ normals[6:].T > offsets[6:]) @ weights[6:]).min() >= lower


def test_the_frame_of_planes_is_undone():
    """Planes turned, moved and scaled, with the frame that puts them back, have the answer of those of the cube."""
    normals, offsets, pads, weights = _long_lists(5, 5000)
    turn = np.linalg.qr(np.random.default_rng(6).normal(size=(3, 3)))[0]
    shift, scale = np.array([0.3, -0.2, 0.1]), 0.25
    frame = np.array([*turn.ravel(), *shift, scale, 3.0, 1e-13])
    own = np.ascontiguousarray(normals @ turn), (offsets - normals @ shift) / scale, pads / 3.0
    nothing = np.empty((0, 3)), np.empty(0), np.empty(0)
    total = int(weights.sum())
    search = 1e-15, total, total // 500, 0.0, 12, 10**6
    center, other, cell = np.empty(3), np.empty(3), np.empty(4)
    best = least_of_cube(normals, offsets, pads, weights, 0, *search, center, cell)
    moved = least_violated(*own, weights, frame, *nothing, *search, 1, other, cell)
    assert moved[:2] == best[:2]
    np.testing.assert_allclose(other, center, rtol=0, atol=1e-12)


def test_least_violated_stays_in_the_domain():
    """The half-space z <= 1/8 has no weight but counts; the one plane asks for z >= 7/8."""
    normals, offsets = unit_planes([(0, 0, 1, 1), (0, 0, -1, -7)])
    center, cell = np.full(3, np.nan), np.full(4, np.nan)
    best, lower, *_ = least_of_cube(
        normals, offsets, np.full(2, 1e-14), np.array([1, UNITS]), 1, 1e-15, UNITS + 1, 0, 0.0, 8,
        10**6, center, cell,
    )  # fmt: skip
    assert (best, lower) == (UNITS, UNITS)
    assert center[2] < 1 / 8


def test_arrays_are_not_converted():
    normals, offsets = unit_planes([(0, 0, 1, 4), (1, 0, 0, 4)])
    reach, pads, weights = reach_of(normals), np.full(2, 1e-14), np.array([1, 1])
    for wrong in (normals.astype(np.float32), np.asfortranarray(normals), normals[:, :2], normals.tolist()):
        with pytest.raises(TypeError, match="incompatible function arguments"):
            exact_cells(wrong, offsets, reach, pads, 4, False)
        with pytest.raises(TypeError, match="incompatible function arguments"):
            violation_cells(wrong, offsets, reach, weights, 0, 1, 1.0, 4)
    with pytest.raises(TypeError, match="incompatible function arguments"):
        violation_cells(normals, offsets, reach, weights.astype(np.int32), 0, 1, 1.0, 4)
    locked = np.zeros(3)
    locked.flags.writeable = False
    for center, cell in ((locked, np.zeros(4)), (np.zeros(4), np.zeros(4)), (np.zeros(3), np.zeros(3))):
        with pytest.raises(TypeError, match="incompatible function arguments"):
            least_of_cube(normals, offsets, pads, weights, 0, 0.0, 1, 1, 0.0, 4, 9, center, cell)
    numbers = np.column_stack([normals, reach, offsets])
    with pytest.raises(TypeError, match="incompatible function arguments"):
        relaxed_cells(numbers, weights, 0, 0, weights, weights, np.array([0, 1, 2]), 4, -1, weights, 99, False)


def codes_of(ijk, level):
    """Three bits a level, x before y before z."""
    bits = [(ijk[:, axis] >> k & 1) << 3 * k + 2 - axis for k in range(level) for axis in range(3)]
    return np.sum([np.zeros(len(ijk), int), *bits], axis=0)


def sums_over(rows, weights, level):
    """What each cell of a level violates, for certain and at most, by the signs at its corners."""
    sums = np.zeros((2, *(2**level,) * 3), np.int64)
    for weight, (low, high, _) in zip(weights, corner_signs(rows, level), strict=True):
        sums += weight * np.array([low > 0, high > 0])
    return sums


@settings(max_examples=30)
@given(plane_rows, st.sampled_from([(0, 0), (0, 1), (1, 0), (0, 2), (1, 1), (2, 0)]), st.integers(0, 2**32 - 1))
def test_add_open_weights(rows, levels, seed):
    """Sums of open cells and all below them, and of voxels, are those of the signs of integers at their corners."""
    (level, below), rng = levels, np.random.default_rng(seed)
    rows = [row for row in rows if abs(row[0]) + abs(row[1]) + abs(row[2]) != 1]  # those meet corners of voxels
    normals, offsets = unit_planes(rows)
    weights = rng.integers(1, 100, len(rows))
    every = np.argwhere(np.ones((2**level,) * 3, bool))
    codes = np.sort(codes_of(every, level)[rng.random(len(every)) < 0.6])
    n_down, last = (8 ** (below + 1) - 1) // 7, level + below
    sums = np.zeros((len(codes), n_down, 2), np.int64)
    bricks = np.zeros((len(codes) << 3 * below, 2, 8, 8, 8), np.int64)
    pads = 1e-13 * 2.0 ** (last + 4)
    numbers = np.column_stack([normals, reach_of(normals) + pads, 0.5 * normals.sum(axis=1) - offsets])
    half = len(rows) // 2
    for part in (slice(half), slice(half, None)):  # chunks add up
        add_open_weights(
            np.ascontiguousarray(numbers[part]), weights[part], level, codes, below, sums.reshape(-1),
            bricks.reshape(-1),
        )  # fmt: skip
    start = 0
    for k in range(below + 1):
        ijk = np.argwhere(np.ones((2 ** (level + k),) * 3, bool))
        ijk = ijk[np.argsort(codes_of(ijk, level + k))]
        exact = sums_over(rows, weights, level + k)[:, ijk[:, 0], ijk[:, 1], ijk[:, 2]]
        low, high = exact.reshape(2, -1, 8**k)[:, codes]
        certain, possible = np.moveaxis(sums[:, start : start + 8**k], 2, 0)
        start += 8**k
        assert (certain <= low).all()
        assert (possible >= high).all()
        clear = ~touched(rows, level + k)[ijk[:, 0], ijk[:, 1], ijk[:, 2]].reshape(-1, 8**k)[codes]
        np.testing.assert_array_equal(certain[clear], low[clear])
        np.testing.assert_array_equal(possible[clear], high[clear])
    fine, clear = sums_over(rows, weights, last + 3), ~touched(rows, last + 3)
    ijk = np.argwhere(np.ones((2**last,) * 3, bool))
    ijk = ijk[np.argsort(codes_of(ijk, last))].reshape(-1, 8**below, 3)[codes].reshape(-1, 3)
    for corner, (certain, possible) in zip(8 * ijk, bricks.transpose(0, 1, 3, 4, 2), strict=True):
        box = tuple(slice(c, c + 8) for c in corner)
        np.testing.assert_array_equal(certain[clear[box]], fine[0][box][clear[box]])
        np.testing.assert_array_equal(possible[clear[box]], fine[1][box][clear[box]])


def touched(rows, level):
    """Cells with a corner on a plane."""
    found = np.zeros((2**level,) * 3, bool)
    for _, _, on_plane in corner_signs(rows, level):
        found |= on_plane
    return found
