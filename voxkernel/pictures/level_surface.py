"""A relaxed kernel as the smooth surface on which the violation reaches its tolerance, by VTK."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._checks import as_depth
from voxkernel._extras import optional
from voxkernel.halfspaces import Domain
from voxkernel.mesh import MeshLike, TriangleMesh, as_mesh
from voxkernel.pictures.silent_vtk import silent_vtk
from voxkernel.relaxed import violation
from voxkernel.voxels import KernelGrid

__all__ = ["RESOLUTION", "level_surface"]

RESOLUTION = 48
_BLOCK = 65536
_LEAST = 1e-3  # of a step: the side of a sample is that of its violation, never of rounding


def level_surface(
    surface: MeshLike, kernel: KernelGrid, *, resolution: int = RESOLUTION
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Contour a relaxed kernel where the violation reaches its tolerance.

    Parameters
    ----------
    surface : mesh, path or (vertices, faces)
        Anything `as_mesh` takes.
    kernel : KernelGrid
        A relaxed kernel of it, from `voxel_kernel` or `voxel_kernels` with a tolerance.
    resolution : int
        Of the violation, along the longest edge of the kernel's box; 2 to 512.

    Returns
    -------
    vertices : (v, 3) float64
        World coordinates.
    faces : (f, 3) int64
        Triangles; none where the kernel is empty, or thinner than the samples.

    Raises
    ------
    ValueError
        If the kernel is not a relaxed one, or `resolution` is out of range.
    MeshError, MeshReadError, TypeError
        If the surface cannot be used.

    Notes
    -----
    A picture, not a bound: the contour is smoothed without shrinking (windowed sinc), because a function that is
    constant between planes leaves steps. Certain are the voxels of `kernel`. Needs PyVista. O(samples^3).

    Examples
    --------
    >>> import voxkernel
    >>> tetrahedron = ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    >>> kernel = voxkernel.voxel_kernel(tetrahedron, tolerance=0.4, depth=4, domain="box")
    >>> vertices, faces = level_surface(tetrahedron, kernel, resolution=16)
    >>> faces.shape[1]
    3
    """
    if not kernel.tolerance:
        raise ValueError("`kernel` must be relaxed, with a tolerance above 0; got an exact one")
    resolution = as_depth("resolution", resolution, 2, 512)
    mesh = as_mesh(surface)
    pyvista = optional("pyvista")
    none = np.zeros((0, 3)), np.zeros((0, 3), np.int64)
    if kernel.is_empty:
        return none
    boxes = [box for grid in (kernel.inside, kernel.boundary) if (box := grid.active_bbox) is not None]
    corner = kernel.axes @ kernel.origin
    low = corner + kernel.voxel_size * np.min([box[0] for box in boxes], axis=0)
    high = corner + kernel.voxel_size * np.max([box[1] + 1 for box in boxes], axis=0)
    step = float((high - low).max()) / resolution
    counts = np.ceil((high - low) / step).astype(int) + 3
    low = 0.5 * (low + high - (counts - 1) * step)
    i, j, k = (np.arange(n) * step for n in counts)
    xyz = np.stack(np.meshgrid(i, j, k, indexing="ij"), axis=-1).reshape(-1, 3) + low
    field = _field(mesh, xyz @ kernel.axes, kernel.tolerance, kernel.domain, step).reshape(counts)
    if field.min() >= 0.0:
        return none
    image: Any = pyvista.ImageData(dimensions=counts.tolist(), spacing=[step] * 3, origin=low.tolist())
    image.point_data["field"] = field.ravel(order="F")
    with silent_vtk():
        contour = image.contour([0.0], scalars="field")
        if not contour.n_points:
            return none
        smooth = contour.smooth_taubin(n_iter=40, pass_band=0.08)
    faces = np.asarray(smooth.regular_faces, dtype=np.int64)
    return np.asarray(smooth.points, dtype=np.float64) @ kernel.axes, faces


def _field(
    mesh: TriangleMesh, points: NDArray[np.float64], tolerance: float, domain: Domain | None, step: float
) -> NDArray[np.float64]:
    """Negative in the kernel: how far the violation is above the tolerance, or a point outside the domain, in steps."""
    above = violation(mesh, points) - tolerance
    near = np.abs(above[above != 0.0])
    scale = float(np.quantile(near, 0.1)) if len(near) else 1.0
    level = np.clip(above / (3.0 * scale), -1.0, 1.0)
    level = np.where(above <= 0.0, np.minimum(level, -_LEAST), np.maximum(level, _LEAST))
    if domain is not None:
        for first in range(0, len(points), _BLOCK):
            own = points[first : first + _BLOCK]
            beyond = (own @ domain.normals.T - domain.offsets).max(axis=1) / step
            level[first : first + _BLOCK] = np.maximum(level[first : first + _BLOCK], np.clip(beyond, -1.0, 1.0))
    return level
