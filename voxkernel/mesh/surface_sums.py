"""Area, centre of mass and volumes of a surface, block by block: no array of sums is as long as the surface."""

from collections.abc import Iterator
from math import fsum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel.mesh.triangles import corner_areas, triple_products, unscaled
from voxkernel.mesh.zero_area import exact_integers

__all__ = ["SurfaceSums", "area_and_centroid", "volume_and_outward"]

_BLOCK = 1 << 16


class SurfaceSums(NamedTuple):
    """A surface whose sums run in units of ``2**exponent`` about `centre`, so that no product overflows."""

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    exponent: int
    centre: NDArray[np.float64]

    def blocks(self) -> Iterator[tuple[slice, NDArray[np.float64]]]:
        """Rows of triangles and their scaled corners, (k, 3, 3)."""
        for start in range(0, len(self.faces), _BLOCK):
            rows = slice(start, start + _BLOCK)
            yield rows, np.ldexp(self.vertices[self.faces[rows]], -self.exponent)

    def scaled_centre(self) -> NDArray[np.float64]:
        """The centre in these units."""
        return np.ldexp(self.centre, -self.exponent)


def area_and_centroid(surface: SurfaceSums) -> tuple[float, NDArray[np.float64]]:
    """Area and centre of mass; of a surface without area the mean of the triangles' middles."""
    areas: list[float] = []
    weighted, middles = np.zeros(3), np.zeros(3)
    for _, scaled in surface.blocks():
        block = corner_areas(scaled)
        local = scaled - surface.scaled_centre()
        middle = local[:, 0] + local[:, 1] + local[:, 2]
        areas.append(float(block.sum()))
        weighted += block @ middle
        middles += middle.sum(axis=0)
    area = fsum(areas)
    centroid = weighted / (3.0 * area) if area > 0.0 else middles / (3.0 * len(surface.faces))
    return (
        float(unscaled(area, 2 * surface.exponent)),
        surface.centre + np.ldexp(centroid, surface.exponent),
    )


def volume_and_outward(surface: SurfaceSums, n_parts: int, labels: NDArray[np.int64]) -> tuple[float, bool]:
    """Signed volume, and is that of every part > 0? Triangles labelled -1 are in no part."""
    volumes: list[float] = []
    sums, terms, rounding, n_faces = np.zeros((4, n_parts))
    for rows, scaled in surface.blocks():
        local, parts = scaled - surface.scaled_centre(), labels[rows]
        if (parts < 0).any():
            local, parts = local[parts >= 0], parts[parts >= 0]
        six_volumes = triple_products(local[:, 0], local[:, 1], local[:, 2])
        reach = np.abs(local).max(axis=2)
        volumes.append(float(six_volumes.sum()))
        np.add.at(sums, parts, six_volumes)
        np.add.at(terms, parts, np.abs(six_volumes))
        np.add.at(rounding, parts, 6.0 * reach[:, 0] * reach[:, 1] * reach[:, 2])
        np.add.at(n_faces, parts, 1.0)
    volume = float(unscaled(fsum(volumes) / 6.0, 3 * surface.exponent))
    # a term a.(b x c) of rounded coordinates is off by < 32 u of 6 |a| |b| |c|; n terms add n u of their sum
    bound = 2.0**-52 * (n_faces * terms + 32.0 * rounding) + 1e-290
    if (sums < -bound).any():
        return volume, False
    unsure = np.flatnonzero(sums <= bound).tolist()
    return volume, all(_exact_volume(surface, labels == part) > 0 for part in unsure)


def _exact_volume(surface: SurfaceSums, chosen: NDArray[np.bool_]) -> int:
    """A positive multiple of the signed volume of closed parts."""
    corners = exact_integers(surface.vertices[surface.faces[chosen]])
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    cross = b[:, [1, 2, 0]] * c[:, [2, 0, 1]] - b[:, [2, 0, 1]] * c[:, [1, 2, 0]]
    return (a * cross).sum()
