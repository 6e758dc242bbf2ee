"""The compiled loops of covers and of their bound, beside slow twins in Python."""

from itertools import combinations

import numpy as np
import pytest

from voxkernel._core import StopFlag, cells_may_see, cover_gains, find_cover, maximal_sets


def packed(sets):
    padded = np.zeros((len(sets), -(-sets.shape[1] // 64) * 64), bool)
    padded[:, : sets.shape[1]] = sets
    return np.packbits(padded, axis=1, bitorder="little").view(np.uint64)


def test_gains_are_counts(rng):
    sets, left = rng.random((30, 150)) < 0.4, rng.random(150) < 0.5
    gains = np.empty(30, np.int64)
    words = packed(sets)
    cover_gains(words.reshape(-1), words.shape[1], packed(left[None])[0], gains)
    assert gains.tolist() == (sets & left).sum(axis=1).tolist()


def test_maximal_sets_are_within_no_other(rng):
    sets = rng.random((60, 130)) < 0.5
    sets[20:40] = sets[:20] & (rng.random((20, 130)) < 0.9)
    sets[50] = sets[3]
    sets[51] = False
    words = packed(sets)
    found = maximal_sets(words.reshape(-1), words.shape[1]).tolist()
    within = lambda i, j: (sets[i] <= sets[j]).all()  # noqa: E731
    expected = [
        i for i in range(60) if not any(within(i, j) and (j < i or not within(j, i)) for j in range(60) if j != i)
    ]
    assert sorted(found) == expected
    assert found == sorted(expected, key=lambda i: (-sets[i].sum(), i))
    assert 50 not in found
    assert 51 not in found


@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_a_cover_is_found_where_there_is_one_and_only_there(rng, count):
    for _ in range(15):
        sets = rng.random((8, 70)) < 0.35
        best = max(sets[list(c)].any(axis=0).sum() for c in combinations(range(8), count))
        words = packed(sets)
        for need in (best - 3, best, best + 1):
            found = find_cover(words.reshape(-1), words.shape[1], count, need, 10**6)
            assert (len(found) > 0) == (need <= best)
            assert len(found) <= count
            assert len(found) == 0 or sets[found].any(axis=0).sum() >= need


def test_a_greedy_choice_is_left_again():
    """The largest set is in no cover by two."""
    sets = np.zeros((3, 12), bool)
    sets[0, :6] = sets[1, 6:] = True
    sets[2, 2:10] = True
    assert sorted(find_cover(packed(sets).reshape(-1), 1, 2, 12, 100).tolist()) == [0, 1]
    assert find_cover(packed(sets).reshape(-1), 1, 1, 9, 100).tolist() == []
    assert find_cover(packed(sets).reshape(-1), 1, 2, 12, 2).tolist() == [-1]


def outside_by(distances, low, step, y, slack):
    f = (y - low) / step
    if not ((f >= 0) & (f < np.array(distances.shape) - 1)).all():
        return 0.0
    at = f.astype(int)
    best = 0.0
    for corner in np.ndindex(2, 2, 2):
        distance = distances[tuple(at + corner)]
        if distance > 0:
            best = max(best, distance - step * np.linalg.norm(f - at - corner) - slack)
    return best


def may_see(distances, low, step, center, half, spot, normal, slack):
    """As the loop does it, one cell and one spot."""
    radius = half * np.sqrt(3.0) + slack
    if normal @ (center - spot) - half * np.abs(normal).sum() > slack:
        return False
    steps = int(np.linalg.norm(spot - center) / (0.7 * step)) + 1
    for s in range(steps):
        t = s / steps
        if outside_by(distances, low, step, center + t * (spot - center), slack) > (1 - t) * radius + slack:
            return False
    return True


def two_balls():
    """Distances outside of two balls of radius 1 at x = -1.5 and 1.5, on a grid; 0 inside."""
    low, step = np.array([-3.0, -2.0, -2.0]), 0.25
    nodes = np.stack(np.meshgrid(*(a + step * np.arange(n) for a, n in zip(low, (25, 17, 17), strict=True)),
                                 indexing="ij"), axis=-1)  # fmt: skip
    apart = [np.linalg.norm(nodes - [x, 0, 0], axis=-1) - 1.0 for x in (-1.5, 1.5)]
    return np.ascontiguousarray(np.maximum(np.minimum(*apart), 0.0)), low, step


def test_cells_beside_a_twin_and_two_balls_that_do_not_see_each_other(rng):
    distances, low, step = two_balls()
    slack = 1e-9
    normals = rng.normal(size=(40, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    side = np.where(np.arange(40) % 2, 1.5, -1.5)
    spots = normals + np.column_stack([side, np.zeros(40), np.zeros(40)])
    centers = np.concatenate([rng.normal((x, 0, 0), 0.5, (12, 3)) for x in (-1.5, 1.5)])
    centers = np.concatenate([centers, [[9.0, 0.0, 0.0]]])  # far outside of the grid, where nothing is known
    halves = rng.uniform(0.02, 0.3, len(centers))
    parents = np.where(np.arange(len(centers)) % 3 == 0, 0, -1)
    before = rng.random((1, 40)) < 0.7
    found = np.ones((len(centers), 40), bool)
    cells_may_see(
        distances, low, step, np.ascontiguousarray(centers), halves, parents, before.reshape(-1),
        np.ascontiguousarray(spots), np.ascontiguousarray(normals), slack, found.reshape(-1),
    )  # fmt: skip
    for i, center in enumerate(centers):
        expected = [
            bool(before[0, j] or parents[i] < 0)
            and may_see(distances, low, step, center, halves[i], spots[j], normals[j], slack)
            for j in range(40)
        ]
        assert found[i].tolist() == expected
    small = halves < 0.1
    left, right = centers[:, 0] < -1.0, (centers[:, 0] > 1.0) & (centers[:, 0] < 3.0)
    inside = np.linalg.norm(centers - np.where(left, -1.5, 1.5)[:, None] * [1, 0, 0], axis=1) < 0.7
    assert not found[small & inside & left][:, (side > 0) & (np.abs(spots[:, 1]) > 0.3)].any()
    assert found[small & inside & right & (parents < 0)][:, side > 0].all()


def test_a_flag_stops_the_loop_over_cells(rng):
    distances, low, step = two_balls()
    stop = StopFlag()
    stop.set()
    normals = np.tile([[1.0, 0, 0]], (500, 1))
    centers = np.tile([[-1.5, 0, 0]], (2000, 1))
    with pytest.raises(KeyboardInterrupt):
        cells_may_see(
            distances, low, step, centers, np.full(2000, 0.1), np.full(2000, -1), np.ones(500, bool),
            normals, normals, 1e-9, np.ones(2000 * 500, bool), stop,
        )  # fmt: skip
