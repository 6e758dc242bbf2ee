"""Pictures made while a mesh is evaluated: a small PNG, and a simplified copy to turn in a browser."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel.evaluation.settings import EvaluateSettings
from voxkernel.measures import Starshapeness
from voxkernel.mesh import TriangleMesh
from voxkernel.mesh.triangles import without_strays
from voxkernel.pictures.scene import Scene, make_scene
from voxkernel.voxels import voxel_kernel

__all__ = ["pictures"]

_SIZE = (240, 180)
_VIEW_FACES = 5000
_RESOLUTION = 28  # along a relaxed kernel
_MARGIN = 0.02  # above the smallest violation: a relaxed kernel large enough to be seen


def pictures(
    mesh: TriangleMesh, score: Starshapeness, settings: EvaluateSettings, *, name: str, view: bool
) -> dict[str, bytes]:
    """Draw what is asked for; keys are paths relative to the run.

    Where no point sees everything, the kernel shown is the relaxed one, 2 % above the smallest violation.
    """
    kernel: Any = score.kernel
    if kernel.is_empty:
        tolerance = min(1.0, score.violation_bounds[1] + _MARGIN)
        kernel = voxel_kernel(
            mesh, tolerance=tolerance, depth=settings.depth, domain=settings.domain, frame="principal"
        )
    scene = make_scene(mesh, kernel, resolution=_RESOLUTION)
    files: dict[str, bytes] = {}
    if settings.thumbnails is not False:
        files[f"thumbnails/{name}.png"] = _thumbnail(scene)
    if view:
        vertices, faces = _simplified(mesh, _VIEW_FACES)
        kernel_vertices, kernel_faces = scene.kernel_vertices, scene.kernel_faces
        if len(kernel_faces) > _VIEW_FACES:
            kernel_vertices, kernel_faces = _clustered(kernel_vertices, kernel_faces, _VIEW_FACES)
        files[f"views/{name}.npz"] = _packed(vertices, faces, kernel_vertices, kernel_faces)
    return files


def _thumbnail(scene: Scene) -> bytes:
    from voxkernel.pictures.png import _draw, _shrunk

    stream = io.BytesIO()
    _shrunk(_draw(scene, _SIZE).image, _SIZE).save(stream, format="PNG", optimize=True)
    return stream.getvalue()


def _packed(
    vertices: NDArray[np.float64], faces: NDArray[np.int64],
    kernel_vertices: NDArray[np.float64], kernel_faces: NDArray[np.int64],
) -> bytes:  # fmt: skip
    stream = io.BytesIO()
    np.savez_compressed(
        stream,
        vertices=vertices.astype(np.float32),
        faces=faces.astype(np.int32),
        kernel_vertices=kernel_vertices.astype(np.float32),
        kernel_faces=kernel_faces.astype(np.int32),
    )
    return stream.getvalue()


def _simplified(mesh: TriangleMesh, n_faces: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Decimate by quadric edge collapse; where that cannot get there, by clustering."""
    if len(mesh.faces) <= n_faces:
        return without_strays(mesh.vertices, mesh.faces)
    from voxkernel.errors import VoxKernelError
    from voxkernel.mesh import repair

    try:
        small = repair(mesh, decimate_to=n_faces).mesh
        if len(small.faces) <= n_faces:
            return small.vertices, small.faces
        mesh = small
    except VoxKernelError:
        pass
    return _clustered(*without_strays(mesh.vertices, mesh.faces), n_faces)


def _clustered(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], n_faces: int
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Merge the vertices of each cell of a grid, coarser until few enough faces are left."""
    low, size = vertices.min(axis=0), max(float(np.ptp(vertices, axis=0).max()), 1e-300)
    for n in (64, 48, 32, 24, 16, 12, 8, 4, 2):
        ijk = np.minimum(((vertices - low) / size * n).astype(np.int64), n - 1)
        _, ids, counts = np.unique((ijk[:, 0] * n + ijk[:, 1]) * n + ijk[:, 2], return_inverse=True, return_counts=True)
        merged = ids.reshape(-1)[faces]
        proper = (merged != np.roll(merged, 1, axis=1)).all(axis=1)
        if int(proper.sum()) <= n_faces:
            sums = np.zeros((len(counts), 3))
            np.add.at(sums, ids.reshape(-1), vertices)
            return sums / counts[:, None], merged[proper]
    return np.zeros((0, 3)), np.zeros((0, 3), np.int64)
