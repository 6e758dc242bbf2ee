"""The best voxel beside looking from every voxel: how much it sees, which one it is, bounds when stopped early."""

import label_shapes
import numpy as np
import pytest

from voxkernel._core import Depths, best_voxel, squared_depths, visible_count


def by_looking_from_all(crop, depths, *, is_flat, spacing=(1.0, 1.0, 1.0)):
    """Of the voxels that see most the deepest, then the nearest to the centroid, then the first."""
    voxels = np.ascontiguousarray(np.argwhere(crop))
    seen = [visible_count(crop, is_flat, v) for v in voxels]
    best = [v for v, n in zip(voxels, seen, strict=True) if n == max(seen)]
    deepest = max(depths[tuple(v)] for v in best)
    best = [v for v in best if depths[tuple(v)] == deepest]
    square = label_shapes.from_centroid(crop, spacing)
    voxel = min(best, key=lambda v: (square(v), v.tolist()))
    return max(seen), int(np.ravel_multi_index(tuple(voxel), crop.shape))


def found_beside_all(image):
    """What the best voxel and the deepest one see; the best one is certified, and that of looking from all."""
    crop, depths = np.pad(image, 1), np.empty(np.add(image.shape, 2))
    squared_depths(crop, False, np.ones(3), depths)
    voxel, seen, upper, _, n_deepest, *_ = best_voxel(crop, False, depths, 0, 6000, 0)
    assert (seen, voxel) == by_looking_from_all(crop, depths, is_flat=False)
    assert upper == seen
    return seen, n_deepest


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
        spacing = (2.0, 1.0, 0.5)
        squared_depths(crop, axes == 2, np.array(spacing), depths)
        voxel, seen, upper, deepest, n_deepest, _, _ = best_voxel(
            crop, axes == 2, depths, 0, 6000, 0, spacing=spacing
        )
        assert (seen, voxel) == by_looking_from_all(crop, depths, is_flat=axes == 2, spacing=spacing)
        assert upper == seen
        assert depths.flat[deepest] == depths[crop != 0].max()
        assert n_deepest == visible_count(crop, axes == 2, np.array(np.unravel_index(deepest, crop.shape)))
        for most_steps in (0, 300, 3000):
            early = best_voxel(crop, axes == 2, depths, 0, 0, most_steps, spacing=spacing)
            assert early[1] == visible_count(crop, axes == 2, np.array(np.unravel_index(early[0], crop.shape)))
            assert n_deepest <= early[1] <= seen <= early[2]


SYMMETRIC = {
    "rod": np.ones((5, 5, 41), np.uint8),
    "plate": np.ones((5, 21, 21), np.uint8),
    "even plate": np.ones((3, 12, 16), np.uint8),
    "stick of a plane": np.ones((1, 3, 61), np.uint8),
}


@pytest.mark.parametrize("name", SYMMETRIC)
def test_the_best_voxel_of_a_symmetric_body_is_its_middle(name):
    body = SYMMETRIC[name]
    crop, is_flat = np.pad(body, 1), body.shape[0] == 1
    depths = Depths(crop, is_flat, np.ones(3))
    voxel, seen, _, deepest, *_ = best_voxel(crop, is_flat, depths, 0, 6000, 0)
    assert seen == body.sum()
    assert voxel == deepest
    assert np.unravel_index(voxel, crop.shape) == tuple((n - 1) // 2 + 1 for n in body.shape)


def test_the_best_voxel_in_a_mirror(rng):
    """Where the centroid tells voxels apart, the best one of the mirror image is the mirror image of the best one."""
    n_told = 0
    for k in range(30):
        x, y, z = (rng.normal(size=(3, 3)) @ np.indices((15, 13, 17)).reshape(3, -1)).reshape(3, 15, 13, 17)
        x, y, z = (v - v.mean() for v in (x, y, z))
        crop = np.pad((x**2 + y**2 / 2 + z**2 / 4 < rng.uniform(5, 60)).astype(np.uint8), 1)
        if not crop.any():
            continue
        spacing = np.array([3.0, 1.0, 1.0]) if k % 2 else np.ones(3)
        voxel, seen, *_ = best_voxel(crop, False, Depths(crop, False, spacing), 0, 6000, 0)
        at = np.unravel_index(voxel, crop.shape)
        mirror = np.ascontiguousarray(crop[::-1, :, ::-1])
        image, also_seen, *_ = best_voxel(mirror, False, Depths(mirror, False, spacing), 0, 6000, 0)
        back = np.unravel_index(image, crop.shape)
        back = (crop.shape[0] - 1 - back[0], back[1], crop.shape[2] - 1 - back[2])
        assert also_seen == seen
        square = label_shapes.from_centroid(crop, spacing)
        assert square(back) == square(at)
        n_told += back == at
    assert n_told > 10


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
        found_beside_all(image)


def dented(rng):
    """Balls with some large dents or many small ones: few voxels are hidden from the deepest one."""
    points = np.indices((17, 17, 17)).reshape(3, -1).T - 8.0
    for k in range(24):
        body = np.linalg.norm(points, axis=1) < 8
        for _ in range((2, 3, 8, 16)[k % 4]):
            at = rng.normal(size=3)
            radius = rng.uniform(3, 5) if k % 4 < 2 else rng.uniform(1, 2.5)
            at *= (9 if k % 4 < 2 else 7) / np.linalg.norm(at)
            body &= np.linalg.norm(points - at, axis=1) > radius
        yield body.reshape(17, 17, 17).astype(np.uint8)


def test_dents_beside_looking_from_every_voxel(rng):
    n_cut = 0
    for image in dented(rng):
        _, n_deepest = found_beside_all(image)
        n_cut += 0 < image.sum() - n_deepest <= 12
    assert n_cut > 8


def long_bodies(rng):
    """Of segments shorter and longer than those that all probes are made of: bent and notched bars in any pose."""
    for k in range(6):
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        x, y, z = np.tensordot(turn, np.indices((45, 45, 45)) - 22.0, 1)
        bar = (np.abs(x) < 21) & (np.abs(y - (k % 3) * (x / 21) ** 2 * 3) < 2.5) & (np.abs(z) < 2)
        yield (bar & ~((np.abs(x - 4) < 3) & (y > 0.5))).astype(np.uint8)


def test_long_bodies_beside_looking_from_every_voxel(rng):
    for image in long_bodies(rng):
        seen, _ = found_beside_all(image)
        assert seen < image.sum()


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


def large_crop(n=104):
    """More than 2**20 voxels: depths of the deepest of each cube are held."""
    crop = np.pad(label_shapes.ball(n), 1)
    crop[30:50, :40, 30:55] = 0
    crop[70:75, 70:75, 70:75] = 0
    assert crop.size > 2**20
    return crop


@pytest.mark.parametrize(
    ("n", "spacing"),
    [(104, (1.0, 1.0, 1.0)), (104, (2.0, 1.0, 1.0)), (104, (0.1, 0.1, 0.1)), (210, (1.0, 1.1, 1.23457))],
)
def test_depths_of_cubes_answer_as_depths(n, spacing):
    """With 0.1 equal depths differ in their last bit; of the last object more than 65,535 depths occur."""
    crop = large_crop(n)
    depths = np.empty(crop.shape)
    squared_depths(crop, False, np.array(spacing), depths)
    cubes = Depths(crop, False, np.array(spacing))
    for most_steps in (0, 300_000) if n < 200 else (0,):
        expected = best_voxel(crop, False, depths, 0, 6000, most_steps, spacing=spacing)
        assert best_voxel(crop, False, cubes, 0, 6000, most_steps) == expected
    assert (len(np.unique(depths)) > 65_536) == (n == 210)


@pytest.mark.parametrize("spacing", [(1.0, 1.0, 1.0), (0.1, 0.1, 0.1), (1.0, 1.1, 1.23457), (3.0, 0.2, 1.0)])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_which_voxel_of_a_large_crop_is_deeper(rng, spacing, axis):
    """Anywhere, near each other, and of equal depth."""
    crop = np.ascontiguousarray(np.swapaxes(large_crop(), 0, axis))
    squares = np.empty(crop.shape)
    squared_depths(crop, False, np.array(spacing), squares)
    depths, flat = Depths(crop, False, np.array(spacing)), squares.ravel()
    square = label_shapes.from_centroid(crop, spacing)
    inside = np.flatnonzero(flat)
    assert (inside == np.flatnonzero(crop)).all()
    some, others = rng.choice(inside, 600), rng.choice(inside, 300)
    others = [*others, *(some[300:] + rng.choice([1, crop.shape[2], crop.shape[2] * crop.shape[1]], 300))]
    by_depth = inside[np.argsort(flat[inside], kind="stable")]
    at = rng.integers(0, len(by_depth) - 1, 300)
    for a, b in zip([*some, *by_depth[at], some[0]], [*others, *by_depth[at + 1], some[0]], strict=True):
        if not flat[b]:
            continue
        of_a, of_b = ((-flat[v], square(np.unravel_index(v, crop.shape)), v) for v in (a, b))
        assert depths.is_deeper(int(a), int(b)) == (of_a < of_b)
        assert depths.is_deeper(int(b), int(a)) == (of_b < of_a)


@pytest.mark.parametrize("spacing", [(1.0, 1.0, 1.0), (0.7, 1.0, 1.3)])
def test_blocks_of_a_large_crop_are_looked_into(spacing):
    """A bar with a dent: the voxels of the smallest blocks are tried by their depth."""
    crop = np.pad(np.ones((40, 40, 698), np.uint8), 1)
    crop[1:4, 1:4, 340:350] = 0
    squares = np.empty(crop.shape)
    squared_depths(crop, False, np.array(spacing), squares)
    expected = best_voxel(crop, False, squares, 0, 6000, 30_000_000, spacing=spacing)
    assert best_voxel(crop, False, Depths(crop, False, np.array(spacing)), 0, 6000, 30_000_000) == expected


def test_a_large_flat_crop(rng):
    crop = np.zeros((3, 1100, 1000), np.uint8)
    crop[1, 1:-1, 1:-1] = rng.random((1098, 998)) < 0.9999
    depths = np.empty(crop.shape)
    squared_depths(crop, True, np.array([1.0, 1.0, 0.7]), depths)
    cubes = Depths(crop, True, np.array([1.0, 1.0, 0.7]))
    expected = best_voxel(crop, True, depths, 0, 6000, 10**6, spacing=(1.0, 1.0, 0.7))
    assert best_voxel(crop, True, cubes, 0, 6000, 10**6) == expected
