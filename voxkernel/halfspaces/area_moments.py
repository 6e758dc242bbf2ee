"""Area, centroid and principal frame of triangles, from their moments."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel import _core
from voxkernel.mesh import TriangleMesh
from voxkernel.mesh.triangles import scale_exponent

__all__ = ["BLOCK", "AreaMoments", "mesh_moments", "moments_of_blocks"]

# Triangles in a block: sums over blocks of another size are rounded otherwise.
BLOCK = 1 << 16

Blocks = Iterable[tuple[NDArray[np.float64], NDArray[np.int64]]]
# Where products of two and of three coordinates stand, each once, in lexical order.
_TWO = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])
_THREE = np.array(
    [[[0, 1, 2], [1, 3, 4], [2, 4, 5]], [[1, 3, 4], [3, 6, 7], [4, 7, 8]], [[2, 4, 5], [4, 7, 8], [5, 8, 9]]]
)


class AreaMoments(NamedTuple):
    """Moments of an area about a point near its middle, in a unit that is a power of two.

    `mean`, `second` and `third` are those of triangles taken as points in their middles, `spread` the second moments
    of the area itself; all but `scaled_area` are divided by the area.
    """

    base: NDArray[np.float64]
    unit: float
    scaled_area: float
    mean: NDArray[np.float64]
    second: NDArray[np.float64]
    third: NDArray[np.float64]
    spread: NDArray[np.float64]

    @property
    def area(self) -> float:
        """In units of the mesh, squared."""
        return self.scaled_area * self.unit**2

    @property
    def centroid(self) -> NDArray[np.float64]:
        """Of the area, in coordinates of the mesh."""
        return self.base + self.mean * self.unit

    def axes(self, second: NDArray[np.float64]) -> NDArray[np.float64]:
        """Principal axes of second moments as rows, longest first, right-handed; signs follow the third moments."""
        axes = np.linalg.eigh(second - np.outer(self.mean, self.mean))[1][:, ::-1].T.copy()
        for axis in axes[:2]:
            along = float(self.mean @ axis)
            cube = self.third @ axis @ axis @ axis - 3.0 * along * (self.second @ axis @ axis) + 2.0 * along**3
            if cube < 0:
                axis *= -1.0
        axes[2] = np.cross(axes[0], axes[1])
        return axes


def moments_of_blocks(blocks: Blocks, low: NDArray[np.float64], high: NDArray[np.float64]) -> AreaMoments:
    """Add up triangles, vertices and faces of which come `BLOCK` at a time; `low` and `high` bound the vertices."""
    base, unit = low + 0.5 * (high - low), 2.0 ** scale_exponent(high - low)
    area, sums = 0.0, [np.zeros(n) for n in (3, 6, 10, 6)]
    for vertices, faces in blocks:
        part, *more = _core.triangle_moments(vertices, faces, base, unit)
        area += part
        sums = [a + b for a, b in zip(sums, more, strict=True)]
    # Needles have an area that floats do not see: then the middle of the box, and the axes of the world.
    mean, second, third, corners = (s / (area or 1.0) for s in sums)
    return AreaMoments(
        base, unit, area, mean, second[_TWO], third[_THREE], ((9.0 * second + corners) / 12.0)[_TWO]
    )  # fmt: skip


def mesh_moments(mesh: TriangleMesh) -> AreaMoments:
    """Add up the triangles of a mesh."""
    vertices, faces = mesh.vertices, mesh.faces
    return moments_of_blocks(((vertices, faces[i : i + BLOCK]) for i in range(0, len(faces), BLOCK)), *mesh.bounds)
