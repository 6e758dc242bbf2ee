"""What a point faces and sees of a surface, as often as it is dragged: what does not change is made once."""

from __future__ import annotations

from importlib.util import find_spec
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel._core import faces_away
from voxkernel._open3d import open3d, ray_scene
from voxkernel.halfspaces import HalfSpaces
from voxkernel.measures import VisibleFraction, visible_fraction
from voxkernel.mesh import TriangleMesh
from voxkernel.relaxed.facet_weights import UNITS, weigh
from voxkernel.relaxed.violated_units import violated_units

__all__ = ["Facing", "Probe", "Sight"]

_SAMPLES = 20_000
_CLOSE = 1e-4  # a hit this close before the middle of a triangle is the triangle


class Facing(NamedTuple):
    """Which triangles have their back to a point, their share of the area, how deep the point lies in the kernel."""

    away: NDArray[np.bool_]
    violation: float
    clearance: float


class Sight(NamedTuple):
    """Which triangles face a point but hide behind others, by their middles, and the share of the area that is seen."""

    hidden: NDArray[np.bool_]
    seen: VisibleFraction


class Probe:
    """Ask a surface what a point faces and sees."""

    def __init__(self, mesh: TriangleMesh) -> None:
        self.mesh = mesh
        self._planes = weigh(HalfSpaces.from_mesh(mesh))
        normals = mesh.facet_normals
        has_area = normals.any(axis=1)
        self._normals, self._firsts = normals[has_area], mesh.vertices[mesh.faces[has_area, 0]]
        self._scene = None
        corners = mesh.vertices[mesh.faces]
        self._middle, self._size = mesh.bounds.mean(axis=0), float(np.ptp(mesh.bounds, axis=0).max())
        self._corners = (corners - self._middle) / self._size

    def facing(self, point: NDArray[np.float64]) -> Facing:
        """Count what is turned away, exactly; the clearance is that to the nearest facet plane, below 0 outside."""
        away = faces_away(self.mesh.vertices, self.mesh.faces, point)
        violation = int(violated_units(self._planes, point[None])[0]) / UNITS
        depths = np.einsum("ij,ij->i", self._normals, self._firsts - point)
        return Facing(away, violation, float(depths.min()))

    @property
    def has_rays(self) -> bool:
        """Whether Open3D is installed."""
        return find_spec("open3d") is not None

    def sight(self, point: NDArray[np.float64], away: NDArray[np.bool_]) -> Sight | None:
        """Cast rays; None where Open3D is not installed."""
        if not self.has_rays:
            return None
        o3d = open3d()
        if self._scene is None:
            self._scene = ray_scene(self._corners.reshape(-1, 3), np.arange(self._corners.size // 3).reshape(-1, 3))
        at = (point - self._middle) / self._size
        ids = np.flatnonzero(~away)
        rays = np.zeros((len(ids), 6), np.float32)
        rays[:, :3] = at
        rays[:, 3:] = self._corners[ids].mean(axis=1) - at
        hits = self._scene.cast_rays(o3d.core.Tensor(rays))
        seen = (hits["t_hit"].numpy() >= 1.0 - _CLOSE) | (hits["primitive_ids"].numpy() == ids)
        hidden = np.zeros(len(away), bool)
        hidden[ids[~seen]] = True
        return Sight(hidden, visible_fraction(self.mesh, point, n_samples=_SAMPLES))
