"""The surface of one object: VTK's surface nets, smoothed, and how star-shaped it is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from voxkernel._extras import optional
from voxkernel.errors import VoxKernelError
from voxkernel.measures import starshapeness
from voxkernel.mesh import TriangleMesh

__all__ = ["SurfaceRow", "surface_of", "surface_row"]

_SMOOTHINGS = 16  # faithful from about 16 voxels across; with less, steps of voxels are taken for defects, with more
# thin parts shrink


@dataclass(frozen=True, slots=True)
class SurfaceRow:
    """What the surface of an object adds to its row."""

    defect_lower: float = float("nan")
    defect_upper: float = float("nan")
    kernel_ratio: float = float("nan")
    verdict: str = ""


def surface_of(crop: NDArray[np.uint8], spacing: tuple[float, float, float]) -> TriangleMesh:
    """Make the closed surface of a crop, in world units from the crop's first voxel, axes in the order of the array."""
    pyvista = optional("pyvista")
    # VTK's first axis changes fastest: the array is handed over as it is, and the axes are turned round.
    image = pyvista.ImageData(dimensions=crop.shape[::-1], spacing=spacing[::-1])
    image.point_data["label"] = crop.ravel()
    net = image.contour_labels(
        boundary_style="external", output_mesh_type="triangles", smoothing_iterations=_SMOOTHINGS, scalars="label",
        smoothing=True,
    )  # fmt: skip
    vertices = np.asarray(net.points, dtype=np.float64)[:, ::-1]
    faces = np.asarray(net.faces).reshape(-1, 4)[:, 1:].astype(np.int64)
    mesh = TriangleMesh.from_triangles(np.ascontiguousarray(vertices), faces)
    # Turning the axes round turns the faces over, or turns them right.
    return mesh if mesh.facts().volume > 0 else TriangleMesh.from_triangles(mesh.vertices, faces[:, ::-1])


def surface_row(crop: NDArray[np.uint8], spacing: tuple[float, float, float]) -> SurfaceRow:
    """Measure the surface of a crop."""
    try:
        score = starshapeness(surface_of(crop, spacing))
    except VoxKernelError:  # a voxel or two shrink to a surface without volume
        return SurfaceRow()
    lower, upper = score.violation_bounds
    ratio = float(score.ratio)
    return SurfaceRow(float(lower), float(upper), ratio, score.verdict)
