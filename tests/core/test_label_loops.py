"""The compiled loops of label images, beside rationals, NumPy and SciPy."""

from fractions import Fraction
from itertools import pairwise

import label_shapes
import numpy as np
import pytest
from scipy import ndimage

from voxkernel._core import (
    StarRaster,
    StopFlag,
    best_voxel,
    fill_holes,
    label_boxes,
    label_parts,
    line_counts,
    ray_lengths,
    squared_depths,
    touched_voxels,
    visible_count,
    visible_voxels,
)
from voxkernel.labels.ray_sets import golden_rays, outward_faces


def supercover(start, end):
    """Voxels whose open cube a segment meets: those of the points between two crossings, in rationals."""
    moves = [int(b - a) for a, b in zip(start, end, strict=True)]
    shares = {Fraction(0), Fraction(1)}
    for n in map(abs, moves):
        shares |= {Fraction(2 * k + 1, 2 * n) for k in range(n)}
    ordered = sorted(shares)
    found = {tuple(map(int, start))}
    for low, high in pairwise(ordered):
        middle = (low + high) / 2
        found.add(tuple(int((int(a) + middle * d + Fraction(1, 2)) // 1) for a, d in zip(start, moves, strict=True)))
    return found


def touched(start, end):
    return [tuple(v) for v in touched_voxels(np.array(start), np.array(end)).tolist()]


def test_segments_beside_rationals(rng):
    for start, end in rng.integers(-9, 10, (400, 2, 3)):
        found = touched(start, end)
        assert len(found) == len(set(found))
        assert set(found) == supercover(start, end)
        assert set(touched(end, start)) == set(found)


def test_segments_through_edges_and_corners():
    assert touched([0, 0, 0], [2, 2, 2]) == [(0, 0, 0), (1, 1, 1), (2, 2, 2)]
    assert touched([0, 0, 0], [0, 1, -1]) == [(0, 0, 0), (0, 1, -1)]
    assert touched([0, 0, 0], [0, 1, 2]) == [(0, 0, 0), (0, 0, 1), (0, 1, 1), (0, 1, 2)]
    assert touched([3, 3, 3], [3, 3, 3]) == [(3, 3, 3)]


def test_long_segments_stay_exact():
    far = 2**20 - 3
    found = touched_voxels(np.array([0, 0, 0]), np.array([far, far - 1, 1]))
    assert len(found) == 2 * far  # far + (far - 1) + 1 crossings; the one in the middle along two axes is one step
    assert found[-1].tolist() == [far, far - 1, 1]


def test_segments_of_flips_and_permutations(rng):
    for d in rng.integers(-8, 9, (50, 3)):
        plain = set(touched([0, 0, 0], d))
        signs, order = rng.choice([-1, 1], 3), rng.permutation(3)
        assert set(touched([0, 0, 0], (d * signs)[order])) == {tuple((np.array(v) * signs)[order]) for v in plain}


def padded(image):
    return np.pad(image if image.ndim == 3 else image[None], 1)


def seen_matrix(crop):
    voxels = np.ascontiguousarray(np.argwhere(crop))
    return voxels, np.array([[all(crop[v] for v in touched(a, b)) for b in voxels] for a in voxels])


def depths_of(crop, is_flat, spacing=(1.0, 1.0, 1.0)):
    depths = np.empty(crop.shape)
    squared_depths(crop, is_flat, np.array(spacing, dtype=float), depths)
    return depths


@pytest.mark.parametrize("spacing", [(1.0, 1.0, 1.0), (2.5, 0.3, 1.0)])
@pytest.mark.parametrize("shape", [(9, 30, 22), (1, 40, 50), (70, 80, 75), (3, 68, 5)])
def test_depths_beside_scipy(rng, shape, spacing):
    """Thin and rough objects, and solid ones of which the middle is more than 32 voxels deep."""
    is_flat = shape[0] == 1
    for share in (1.0, 0.999, 0.7):
        crop = np.pad((rng.random(shape) < share).astype(np.uint8), 1)
        found = depths_of(crop, is_flat, spacing)
        expected = ndimage.distance_transform_edt(crop[1] if is_flat else crop, sampling=spacing[is_flat:]) ** 2
        np.testing.assert_allclose(found[1] if is_flat else found, expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("is_flat", [False, True])
def test_views_and_the_best_voxel_beside_all_pairs(rng, is_flat):
    for keep in (0.3, 0.6, 0.8):
        crop = padded(label_shapes.blobs(rng, (12, 12) if is_flat else (6, 6, 6), keep))
        voxels, seen = seen_matrix(crop)
        assert (seen == seen.T).all()
        counts = seen.sum(axis=1)
        painted = np.empty_like(crop)
        for k, v in enumerate(voxels):
            assert visible_count(crop, is_flat, v) == counts[k]
            assert visible_voxels(crop, is_flat, v, painted) == counts[k]
            assert (painted[crop != 0] == seen[k]).all()
            assert not painted[crop == 0].any()
        spacing = (2.0, 1.0, 0.7)
        depths = depths_of(crop, is_flat, spacing)
        voxel, n_seen, upper, deepest, n_deepest, _, _ = best_voxel(
            crop, is_flat, depths, 0, 6000, 0, spacing=spacing
        )
        assert n_seen == upper == counts.max()
        at = depths[crop != 0]
        near = [-square for square in map(label_shapes.from_centroid(crop, spacing), voxels)]
        best = max(np.flatnonzero(counts == counts.max()), key=lambda k: (at[k], near[k], -k))
        first = max(range(len(voxels)), key=lambda k: (at[k], near[k], -k))
        assert voxel == np.ravel_multi_index(voxels[best], crop.shape)
        assert deepest == np.ravel_multi_index(voxels[first], crop.shape)
        assert n_deepest == counts[first]
        for most_steps in (0, 3000, 30_000):
            _, low, high, *_ = best_voxel(crop, is_flat, depths, 0, 0, most_steps)
            assert low <= counts.max() <= high


def test_blocks_bound_an_object_that_is_not_raced_to_the_end():
    """A long C: from one arm the other is hidden, and few steps are enough to know."""
    crop = padded(label_shapes.c_shape(30, 6))
    depths = depths_of(crop, False)
    _, best, same, *_ = best_voxel(crop, False, depths, 0, 10**6, 0)
    assert best == same
    bounds = [best_voxel(crop, False, depths, 0, 0, steps)[1:3] for steps in (0, 10**4, 10**5, 10**6)]
    assert all(low <= best <= high for low, high in bounds)
    assert bounds[0][1] >= bounds[-1][1]
    assert bounds[-1][1] < 0.75 * crop.sum()


@pytest.mark.parametrize("is_flat", [False, True])
def test_filled_holes_beside_scipy(rng, is_flat):
    for _ in range(20):
        shape = rng.integers(3, 25, 2) if is_flat else rng.integers(3, 12, 3)
        image = (rng.random(tuple(shape)) < 0.75).astype(np.uint8)
        crop = padded(image)
        filled = np.empty_like(crop)
        fill_holes(crop, is_flat, filled)
        assert (filled == padded(ndimage.binary_fill_holes(image).astype(np.uint8))).all()


@pytest.mark.parametrize("is_flat", [False, True])
def test_lines_beside_numpy(rng, is_flat):
    crop = padded(label_shapes.blobs(rng, (20, 17) if is_flat else (9, 12, 15), 0.5))
    found = [np.full((crop.shape[a], crop.shape[b]), -1) for a, b in ((0, 1), (0, 2), (1, 2))]
    line_counts(crop, is_flat, *found)
    assert all((plane == crop.sum(axis)).all() for plane, axis in zip(found, (2, 1, 0), strict=True))


def test_parts_of_many_rows():
    """Rings in rings, joined by corners only, or not at all; a cavity that is open by a corner stays one."""
    image = np.zeros((9, 9, 9), np.uint8)
    for k in (0, 2, 4):
        image[k : 9 - k, k : 9 - k, k : 9 - k] = 1
        image[k + 1 : 8 - k, k + 1 : 8 - k, k + 1 : 8 - k] = 0
    sizes = [n**3 - max(n - 2, 0) ** 3 for n in (9, 7, 5, 3, 1)]
    assert label_parts(padded(image), False) == (3, sizes[0], 2, sizes[1] + sizes[3])
    image[1, 1, 1] = 1
    assert label_parts(padded(image), False) == (2, sizes[0] + 1 + sizes[2], 2, sizes[1] - 1 + sizes[3])
    image[0, 0, 0] = 0
    image[1, 1, 1] = 0
    assert label_parts(padded(image), False) == (3, sizes[0] - 1, 2, sizes[1] + sizes[3])


@pytest.mark.parametrize("is_flat", [False, True])
def test_parts_beside_scipy(rng, is_flat):
    for keep in (0.2, 0.5, 0.8):
        crop = padded((rng.random((15, 15) if is_flat else (7, 8, 9)) < keep).astype(np.uint8))
        plane = crop[1] if is_flat else crop
        pieces, n = ndimage.label(plane, np.ones((3,) * plane.ndim))
        holes, n_holes = ndimage.label(plane == 0)
        outside = int((holes == holes[(0,) * plane.ndim]).sum())
        largest = int(np.bincount(pieces.ravel())[1:].max())
        assert label_parts(crop, is_flat) == (n, largest, n_holes - 1, int((plane == 0).sum()) - outside)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.uint32, np.int64])
def test_boxes_beside_numpy(rng, dtype):
    image = rng.integers(0, 5, (4, 5, 6)).astype(dtype) * (np.iinfo(dtype).max // 5)
    labels, sizes, boxes = label_boxes(image)
    assert set(labels.tolist()) == set(np.unique(image).tolist()) - {0}
    for label, size, box in zip(labels, sizes, boxes, strict=True):
        at = np.argwhere(image == label)
        assert size == len(at)
        assert box.tolist() == [*at.min(axis=0), *(at.max(axis=0) + 1)]


def test_rays_of_a_box():
    crop = padded(np.ones((3, 5, 7), np.uint8))
    center = np.array([2, 3, 4])
    directions = np.array([[1, 0, 0], [0, -1, 0], [0, 0, 2], [1, 1, 1.0], [0, 1, 1]])
    lengths = np.empty(5)
    ray_lengths(crop, False, center, directions, False, lengths)
    assert lengths.tolist() == [1.5, 2.5, 1.75, 1.5, 2.5]
    ray_lengths(crop, False, center, directions[:3], True, lengths[:3])
    assert lengths[:3].tolist() == [2.0, 3.0, 2.0]


def in_polyhedron(points, ends, faces):
    inside = np.zeros(len(points), dtype=bool)
    for face in faces:
        shares = np.linalg.solve(ends[face].T, points.T)
        inside |= (shares >= 0).all(axis=0) & (shares.sum(axis=0) <= 1)
    return inside


def test_rows_beside_barycentric_coordinates(rng):
    shape = np.array([12, 13, 14])
    crop = padded(label_shapes.blobs(rng, tuple(shape - 2), 0.6))
    directions = golden_rays(40)
    faces = outward_faces(directions)
    center = np.array([6, 6, 7])
    for _ in range(5):
        ends = directions * rng.uniform(2.0, 9.0, 40)[:, None]  # also out of the image
        low, high = np.array([0, 1, 2]), shape - 3
        box = np.argwhere(np.ones(high - low + 1)) + low
        inside = in_polyhedron(box - center + 1e-7 * rng.normal(size=(1, 3)), ends, faces)
        common = int(crop[tuple(box[inside].T)].sum())
        size, both = StarRaster(crop, False).count(center, ends, faces, low, high)
        assert abs(size - inside.sum()) <= 1
        assert abs(both - common) <= 1


def test_rows_of_a_polygon(rng):
    crop = padded(label_shapes.blobs(rng, (20, 20), 0.6))
    angles = 2 * np.pi * np.arange(12) / 12
    center, nothing = np.array([1, 10, 11]), np.zeros((0, 3), np.int64)
    for turn in (1, -1):
        unit = np.stack([np.zeros(12), np.sin(turn * angles), np.cos(angles)], axis=1)
        ends = unit * rng.uniform(3.0, 8.0, 12)[:, None]
        box = np.argwhere(np.ones((22, 22)))
        points = box - center[1:] + 1e-7
        inside = np.zeros(len(points), dtype=bool)
        for k in range(12):
            shares = np.linalg.solve(ends[[k, k - 1], 1:].T, points.T)
            inside |= (shares >= 0).all(axis=0) & (shares.sum(axis=0) <= 1)
        size, both = StarRaster(crop, True).count(center, ends, nothing, np.zeros(3, np.int64), np.array([2, 21, 21]))
        assert abs(size - inside.sum()) <= 1
        assert abs(both - int(crop[1][tuple(box[inside].T)].sum())) <= 1


def test_a_flag_stops_a_race():
    stop = StopFlag()
    stop.set()
    crop = padded(label_shapes.c_shape(120, 30))
    with pytest.raises(KeyboardInterrupt):
        best_voxel(crop, False, depths_of(crop, False), 0, 10**9, 0, stop)
