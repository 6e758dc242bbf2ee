"""Label images by formula, with what is known of them."""

from fractions import Fraction

import numpy as np


def places(shape):
    return np.indices(shape).astype(float)


def ball(n, *, axes=3):
    """Diameter n (odd), centred on a voxel: all is seen from the middle."""
    middle = (n - 1) / 2
    return (sum((p - middle) ** 2 for p in places((n,) * axes)) <= (n / 2) ** 2).astype(np.uint8)


def octagonal(rng, n, axes=3):
    """Half-spaces with one or two of the axes, equally weighted: a segment between two voxels touches no other ones.

    A touched voxel is less than 1/2 from the segment along each axis, so that a sum of two such coordinates is less
    than 1 above what the ends allow.
    """
    ijk = np.indices((n,) * axes)
    inside = np.ones((n,) * axes, dtype=bool)
    for a in range(axes):
        for b in range(a):
            for sign in (1, -1):
                value = ijk[a] + sign * ijk[b]
                low, high = np.sort(rng.integers(value.min(), value.max() + 1, 2))
                inside &= (value >= min(low, np.median(value) - 1)) & (value <= max(high, np.median(value) + 1))
    return inside.astype(np.uint8)


def c_shape(n=15, width=4):
    """A square ring with a gap: the slit is as wide as an arm."""
    image = np.zeros((width, n, n), np.uint8)
    image[:, :, :] = 1
    image[:, width : n - width, width:] = 0
    return image


def shell(n=13):
    """A ball without its core: one hole."""
    outer = ball(n)
    core = np.pad(ball(n - 8), 4)
    return outer - core


def dumbbell(n=21, radius=5):
    """Two balls that meet in a row of voxels."""
    p = places((2 * radius + 1, 2 * radius + 1, n))
    c = radius
    two = sum(
        ((p[0] - c) ** 2 + (p[1] - c) ** 2 + (p[2] - m) ** 2 <= (radius + 0.5) ** 2).astype(int)
        for m in (c, n - 1 - c)
    )
    bar = (p[0] == c) & (p[1] == c)
    return ((two > 0) | bar).astype(np.uint8)


def blobs(rng, shape, keep=0.5):
    from scipy import ndimage

    field = ndimage.gaussian_filter(rng.random(shape), 1.2)
    return (field > np.quantile(field, 1 - keep)).astype(np.uint8)


def from_centroid(crop, spacing=(1.0, 1.0, 1.0)):
    """Squares of distances from the centroid of an object, times that of its number of voxels, exact, for any voxel."""
    voxels = np.argwhere(crop)
    n, sums = len(voxels), voxels.sum(0)

    def square(voxel):
        return sum((Fraction(s) * int(d)) ** 2 for s, d in zip(spacing, n * np.asarray(voxel) - sums, strict=True))

    return square
