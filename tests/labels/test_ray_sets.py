"""Directions of rays in a plane: the same numbers in a mirror, and what follows for overlaps."""

import label_shapes
import numpy as np
import pytest

from voxkernel import label_stars
from voxkernel.labels.ray_sets import circle_rays, ray_set


@pytest.mark.parametrize("n", [1, 2, 3, 5, 6, 8, 12, 32, 96, 100, 255, 256])
def test_equal_angles(n):
    sine, cosine = circle_rays(n)
    angle = 2 * np.pi * np.arange(n) / n
    np.testing.assert_allclose(sine, np.sin(angle), atol=4e-16)
    np.testing.assert_allclose(cosine, np.cos(angle), atol=4e-16)
    rays = set(zip(sine.tolist(), cosine.tolist(), strict=True))
    assert rays == {(-x, y) for x, y in rays}
    if n % 4 == 0:
        assert rays == {(y, x) for x, y in rays} == {(x, -y) for x, y in rays}
    assert (ray_set(n, (1.0, 2.0)).steps[:, 2] == cosine / 2.0).all()


def test_a_ray_along_a_diagonal_passes_corners_as_segments_do():
    stars = label_stars(np.eye(9, dtype=np.uint8), spacing=(1, 1), n_rays=(8, 32))
    assert stars.visible[0] == 1.0
    assert (stars.iou == 1.0).all()


def test_overlaps_in_a_mirror(rng):
    n_compared = 0
    for k in range(60):
        image = label_shapes.blobs(rng, tuple(rng.integers(6, 20, 2)), 0.7)
        if not image.any():
            continue
        spacing = (1.0, 1.0) if k % 2 else (2.0, 0.7)
        own = label_stars(image, spacing=spacing)
        for mirrored, back in ((image[::-1], (-1, 1)), (image[:, ::-1], (1, -1))):
            other = label_stars(np.ascontiguousarray(mirrored), spacing=spacing)
            center = [n - 1 - c if b < 0 else c for n, c, b in zip(image.shape, other.center[0], back, strict=True)]
            assert other.visible[0] == own.visible[0]
            if center != own.center[0].tolist():
                continue  # two voxels as near to the centroid
            np.testing.assert_array_equal(other.iou, own.iou)
            np.testing.assert_array_equal(other.iou_stepped, own.iou_stepped)
            n_compared += 1
    assert n_compared > 80
