"""The best voxel beside looking from every voxel: how much it sees, which one it is, bounds when stopped early."""

import label_shapes
import numpy as np
import pytest

from voxkernel._core import best_voxel, squared_depths, visible_count


def by_looking_from_all(crop, depths, *, is_flat):
    ranked = [
        (-visible_count(crop, is_flat, v), -depths[tuple(v)], int(np.ravel_multi_index(tuple(v), crop.shape)))
        for v in np.ascontiguousarray(np.argwhere(crop))
    ]
    seen, _, voxel = min(ranked)
    return -seen, voxel


def images(rng, axes):
    for k in range(12):
        shape = tuple(rng.integers(2, 11, 3)) if axes == 3 else (1, *rng.integers(2, 30, 2))
        yield label_shapes.blobs(rng, shape, rng.uniform(0.3, 0.9)) if k % 3 else (rng.random(shape) < 0.7).astype("u1")
    if axes == 3:  # rows of more than 64 voxels, more blocks than one level holds
        for n in (61, 66, 140):
            yield (rng.random((2, 3, n)) < 0.97).astype(np.uint8)
        yield (rng.random((70, 70, 70)) < 0.001).astype(np.uint8)
    yield label_shapes.c_shape(9, 2) if axes == 3 else label_shapes.c_shape(15, 1)


@pytest.mark.parametrize("axes", [2, 3])
def test_beside_looking_from_every_voxel(rng, axes):
    for image in images(rng, axes):
        if not image.any():
            continue
        crop, depths = np.pad(image, 1), np.empty(np.add(image.shape, 2))
        squared_depths(crop, axes == 2, np.array([2.0, 1.0, 0.5]), depths)
        voxel, seen, upper, deepest, n_deepest, _, _ = best_voxel(crop, axes == 2, depths, 0, 6000, 0)
        assert (seen, voxel) == by_looking_from_all(crop, depths, is_flat=axes == 2)
        assert upper == seen
        assert depths.flat[deepest] == depths[crop != 0].max()
        assert n_deepest == visible_count(crop, axes == 2, np.array(np.unravel_index(deepest, crop.shape)))
        for most_steps in (0, 300, 3000):
            early = best_voxel(crop, axes == 2, depths, 0, 0, most_steps)
            assert early[1] == visible_count(crop, axes == 2, np.array(np.unravel_index(early[0], crop.shape)))
            assert n_deepest <= early[1] <= seen <= early[2]


def near_stars(rng):
    """Bodies of several tiles, turned at random, from which little is hidden in the middle."""
    for k in range(9):
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        x, y, z = np.tensordot(turn, np.indices((21, 21, 21)) / 10 - 1, 1)
        flat = (np.hypot(x, y) < 0.6 + 0.3 * np.cos((3 + k) * np.arctan2(y, x))) & (np.abs(z) < 0.3)
        angle = (np.abs([x, y, z]) < 0.7).all(0) & ((x < -0.1) | (y < -0.1)) & (np.abs(z) < 0.35)
        lobes = (np.hypot(np.hypot(x - 0.4, y), z) < 0.45) | (np.hypot(np.hypot(x + 0.4, y), z) < 0.5)
        yield (flat, angle, lobes)[k % 3].astype(np.uint8)


def test_near_stars_beside_looking_from_every_voxel(rng):
    for image in near_stars(rng):
        crop, depths = np.pad(image, 1), np.empty(np.add(image.shape, 2))
        squared_depths(crop, False, np.ones(3), depths)
        voxel, seen, upper, *_ = best_voxel(crop, False, depths, 0, 6000, 0)
        assert (seen, voxel) == by_looking_from_all(crop, depths, is_flat=False)
        assert upper == seen


def test_another_voxel_is_looked_at_too(rng):
    crop, depths = np.pad(label_shapes.c_shape(9, 2), 1), np.empty((4, 11, 11))
    squared_depths(crop, False, np.ones(3), depths)
    found = {best_voxel(crop, False, depths, 0, 6000, 0)[:5]}
    for other in rng.permutation(crop.size)[:60].tolist():
        *rest, seen, _ = best_voxel(crop, False, depths, other, 6000, 0)
        at = np.array(np.unravel_index(other, crop.shape))
        assert seen == (visible_count(crop, False, at) if crop.flat[other] else 0)
        found.add(tuple(rest))
    assert len(found) == 1
    star = np.pad(label_shapes.ball(7), 1)
    depths = np.empty(star.shape)
    squared_depths(star, False, np.ones(3), depths)
    rim = int(np.flatnonzero(star)[0])
    voxel, seen, *_, other_seen, _ = best_voxel(star, False, depths, rim, 6000, 0)
    assert voxel == star.size // 2  # the deepest of those that see all
    assert seen == star.sum()
    assert other_seen == visible_count(star, False, np.array(np.unravel_index(rim, star.shape)))


def test_levels_of_blocks(rng):
    """So many voxels that blocks are cut twice; what is bounded beside what is found with more time."""
    crop = np.pad(label_shapes.c_shape(44, 11), 1)
    depths = np.empty(crop.shape)
    squared_depths(crop, False, np.ones(3), depths)
    _, seen, upper, *_ = best_voxel(crop, False, depths, 0, 0, 30_000_000)
    _, early, early_upper, *_ = best_voxel(crop, False, depths, 0, 0, 3_000_000)
    assert early <= seen <= upper <= early_upper
    assert upper < 0.9 * crop.sum()
