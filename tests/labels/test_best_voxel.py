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
        voxel, seen, upper, deepest, n_deepest, _ = best_voxel(crop, axes == 2, depths, 6000, 0)
        assert (seen, voxel) == by_looking_from_all(crop, depths, is_flat=axes == 2)
        assert upper == seen
        assert depths.flat[deepest] == depths[crop != 0].max()
        assert n_deepest == visible_count(crop, axes == 2, np.array(np.unravel_index(deepest, crop.shape)))
        for most_steps in (0, 300, 3000):
            early = best_voxel(crop, axes == 2, depths, 0, most_steps)
            assert early[1] == visible_count(crop, axes == 2, np.array(np.unravel_index(early[0], crop.shape)))
            assert n_deepest <= early[1] <= seen <= early[2]


def test_levels_of_blocks(rng):
    """So many voxels that blocks are cut twice; what is bounded beside what is found with more time."""
    crop = np.pad(label_shapes.c_shape(44, 11), 1)
    depths = np.empty(crop.shape)
    squared_depths(crop, False, np.ones(3), depths)
    _, seen, upper, *_ = best_voxel(crop, False, depths, 0, 30_000_000)
    _, early, early_upper, *_ = best_voxel(crop, False, depths, 0, 3_000_000)
    assert early <= seen <= upper <= early_upper
    assert upper < 0.9 * crop.sum()
