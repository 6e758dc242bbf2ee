"""Area, centre of mass and volumes of a surface, block by block: no array of sums is as long as the surface."""

from math import fsum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel.mesh.edges import SurfaceEdges
from voxkernel.mesh.triangles import corner_areas, scale_exponent, triple_products, unscaled
from voxkernel.mesh.zero_area import exact_integers

__all__ = ["SurfaceSums", "surface_sums"]

_BLOCK = 1 << 16


class SurfaceSums(NamedTuple):
    """Sums over a surface; the last two where it is closed and oriented."""

    area: float
    area_centroid: NDArray[np.float64]  # of a surface without area as floats see it, the mean of the triangles' middles
    volume: float
    is_outward: bool | None  # is the volume of every part > 0?


def surface_sums(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], bbox: NDArray[np.float64], edges: SurfaceEdges
) -> SurfaceSums:
    """All sums in one pass, about the middle of the bounding box and in units in which no product overflows."""
    exponent = scale_exponent(bbox)
    centre = 0.5 * bbox[0] + 0.5 * bbox[1]
    scaled_centre = np.ldexp(centre, -exponent)
    is_solid = edges.is_closed and edges.is_oriented
    volumes = _Volumes(edges.n_parts)
    areas: list[float] = []
    weighted, middles = np.zeros(3), np.zeros(3)
    for start in range(0, len(faces), _BLOCK):
        rows = slice(start, start + _BLOCK)
        corners = np.ldexp(vertices.take(faces[rows], axis=0), -exponent)  # quicker than an index
        block = corner_areas(corners)
        corners -= scaled_centre
        middle = corners[:, 0] + corners[:, 1] + corners[:, 2]
        areas.append(float(block.sum()))
        weighted += block @ middle
        middles += middle.sum(axis=0)
        if is_solid:
            volumes.add(corners, edges.parts[rows])
    area = fsum(areas)
    centroid = weighted / (3.0 * area) if area > 0.0 else middles / (3.0 * len(faces))
    return SurfaceSums(
        area=float(unscaled(area, 2 * exponent)),
        area_centroid=centre + np.ldexp(centroid, exponent),
        volume=float(unscaled(fsum(volumes.blocks) / 6.0, 3 * exponent)) if is_solid else float("nan"),
        is_outward=volumes.are_positive(vertices, faces, edges.parts) if is_solid else None,
    )


class _Volumes:
    """Six times the signed volumes of parts, with what bounds their rounding."""

    def __init__(self, n_parts: int) -> None:
        self.blocks: list[float] = []
        self.sums, self.terms, self.rounding, self.n_faces = np.zeros((4, n_parts))

    def add(self, corners: NDArray[np.float64], parts: NDArray[np.int64]) -> None:
        """Add triangles, (k, 3, 3); those of part -1 are in none."""
        if (parts < 0).any():
            corners, parts = corners[parts >= 0], parts[parts >= 0]
        six_volumes = triple_products(corners[:, 0], corners[:, 1], corners[:, 2])
        reach = np.abs(corners).max(axis=2)
        self.blocks.append(float(six_volumes.sum()))
        np.add.at(self.sums, parts, six_volumes)
        np.add.at(self.terms, parts, np.abs(six_volumes))
        np.add.at(self.rounding, parts, 6.0 * reach[:, 0] * reach[:, 1] * reach[:, 2])
        np.add.at(self.n_faces, parts, 1.0)

    def are_positive(
        self, vertices: NDArray[np.float64], faces: NDArray[np.int64], labels: NDArray[np.int64]
    ) -> bool:
        """Is every part's volume > 0? The float sum where it is certain, integers where it is not."""
        # a term a.(b x c) of rounded coordinates is off by < 32 u of 6 |a| |b| |c|; n terms add n u of their sum
        bound = 2.0**-52 * (self.n_faces * self.terms + 32.0 * self.rounding) + 1e-290
        if (self.sums < -bound).any():
            return False
        unsure = np.flatnonzero(self.sums <= bound).tolist()
        return all(_exact_volume(vertices[faces[labels == part]]) > 0 for part in unsure)


def _exact_volume(triangles: NDArray[np.float64]) -> int:
    """A positive multiple of the signed volume of closed triangles (m, 3, 3)."""
    corners = exact_integers(triangles)
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    cross = b[:, [1, 2, 0]] * c[:, [2, 0, 1]] - b[:, [2, 0, 1]] * c[:, [1, 2, 0]]
    return (a * cross).sum()
