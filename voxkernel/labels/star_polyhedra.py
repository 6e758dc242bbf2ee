"""Many polyhedra given by lengths of rays, as StarDist predicts them -> the kernel of each."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from voxkernel._checks import as_depth, as_integers, as_points, check_index_range, read_only
from voxkernel._core import StopFlag, star_kernels
from voxkernel._frozen import Frozen
from voxkernel._threads import run_parts
from voxkernel.exact import kernel_of_halfspaces
from voxkernel.halfspaces import HalfSpaces
from voxkernel.labels.ray_sets import outward_faces
from voxkernel.mesh import TriangleMesh

__all__ = ["StarKernels", "star_polyhedra_kernels"]

_PART = 256
_LEAST, _MOST = 1e-60, 1e60  # of lengths, whose volumes are numbers


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class StarKernels(Frozen):
    """Kernels of star polyhedra: arrays with one row per polyhedron, read-only.

    Attributes
    ----------
    volume : (n,) float64
        Of the kernel, > 0: a star polyhedron is seen from its centre.
    polyhedron_volume : (n,) float64
        Of the polyhedron.
    low, high : (n, 3) float64
        The box of the kernel, axes as those of the centres.
    n_general : int
        How many were left to the code of `exact_kernel`, because floating point did not tell.
    """

    volume: NDArray[np.float64]
    polyhedron_volume: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    n_general: int

    def __len__(self) -> int:
        """Return the number of polyhedra."""
        return len(self.volume)


def star_polyhedra_kernels(
    centers: ArrayLike, distances: ArrayLike, rays: ArrayLike, *, faces: ArrayLike | None = None, threads: int = 1
) -> StarKernels:
    """Compute the kernels of many polyhedra with corners ``center + distance * ray``.

    Parameters
    ----------
    centers : (n, 3) float
        In any unit; axes as those of the rays.
    distances : (n, m) float
        Length of each ray, > 0; from 1e-60 to 1e60, also times the length of its direction.
    rays : (m, 3) float
        Directions, the same for all polyhedra, such as `Rays_GoldenSpiral(96).vertices` of StarDist; of lengths from
        1e-60 to 1e60.
    faces : (f, 3) int, optional
        Triangles between the rays; by default those of the convex hull of the directions, scaled to length 1.
    threads : int
        Threads, at least 1; the result does not depend on it.

    Returns
    -------
    StarKernels
        One row per polyhedron.

    Raises
    ------
    TypeError, ValueError
        If a shape or a number cannot be used, or the rays do not surround the centre.

    Notes
    -----
    The centre is in every kernel, so the kernel is the polar body of the hull of points n / d, one a face n . x <= d.
    That hull is made in floating point, nearest faces first, and checked: the faces of the hull close around the
    centre, and no point is more than 1e-9 beyond any of them, which bounds the kernel between two bodies that differ by
    so much. Where that fails, as for faces that are nearly in one plane, every face is cut out of its own plane by all
    others; where their edges do not fit, the code of `exact_kernel` answers.

    Examples
    --------
    >>> rays = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1.0]])
    >>> kernels = star_polyhedra_kernels([[0, 0, 5]], np.ones((1, 6)), rays)  # an octahedron
    >>> kernels.volume.round(6).tolist(), kernels.high.round(6).tolist()
    ([1.333333], [[1.0, 1.0, 6.0]])
    """
    directions = as_points("rays", rays)
    middle = as_points("centers", centers)
    lengths = as_points("distances", distances, columns=len(directions))
    n_threads = as_depth("threads", threads, 1, 256)
    if len(lengths) != len(middle):
        raise ValueError(f"`distances` must have one row for each of {len(middle)} centers; got {len(lengths)}")
    if lengths.size and lengths.min() <= 0.0:
        raise ValueError(f"`distances` must be > 0; got {lengths.min():g}")
    if len(directions) < 4 or not directions.any(axis=1).all():
        raise ValueError(f"`rays` must be at least 4 directions, none of them 0; got {len(directions)}")
    norms = np.hypot(np.hypot(directions[:, 0], directions[:, 1]), directions[:, 2])  # no squares that overflow
    _check_range("`rays` must have lengths from", norms)
    _check_range("`distances` must be from", lengths)
    _check_range("`distances` times the lengths of `rays` must be from", lengths * norms)
    norms = np.linalg.norm(directions, axis=1)
    units = directions / norms[:, None]
    if faces is not None:
        faces = as_integers("faces", faces, shape="(f, 3)", ndim=2, columns=3)
        check_index_range("faces", faces, len(directions))
    triangles = _triangles(units.tobytes(), None if faces is None else faces.tobytes())
    n = len(middle)
    volume, boxes, outcome = np.zeros(n), np.zeros((n, 6)), np.zeros(n, np.int8)

    spans = lengths * norms

    def part(first: int, stop: StopFlag) -> None:
        star_kernels(units, triangles, spans, first, min(n, first + _PART), volume, boxes, outcome, stop)

    run_parts(part, range(0, n, _PART), n_threads)
    general = np.flatnonzero(outcome == 0).tolist()
    for i in general:
        volume[i], boxes[i] = _general(directions * lengths[i][:, None], triangles)
    corners = np.linalg.det(directions[triangles]) / 6.0
    whole = np.prod(lengths[:, triangles], axis=2) @ corners if n else np.zeros(0)
    return StarKernels(
        volume=volume, polyhedron_volume=whole, low=boxes[:, :3] + middle, high=boxes[:, 3:] + middle,
        n_general=len(general),
    )  # fmt: skip


def _check_range(words: str, values: NDArray[np.float64]) -> None:
    wrong = values[(values < _LEAST) | (values > _MOST)]
    if len(wrong):
        raise ValueError(f"{words} {_LEAST:g} to {_MOST:g}; got {wrong[0]:g}")


@lru_cache(maxsize=16)
def _triangles(unit_bytes: bytes, face_bytes: bytes | None) -> NDArray[np.int64]:
    """Triangles that the centre is behind, closed around it; kept, as many calls have the same rays."""
    from scipy.spatial import QhullError

    units = np.frombuffer(unit_bytes).reshape(-1, 3)
    if face_bytes is None:
        try:
            triangles = outward_faces(units)
        except QhullError:
            raise ValueError("`rays` must surround the centre; got directions in one plane") from None
    else:
        triangles = np.frombuffer(face_bytes, np.int64).reshape(-1, 3).copy()
        turned = np.linalg.det(units[triangles]) < 0.0
        triangles[turned] = triangles[turned][:, ::-1]
    if (np.linalg.det(units[triangles]) <= 1e-12).any():
        raise ValueError("`rays` must surround the centre, no face in one plane with it; got some that do not")
    facts = TriangleMesh.from_triangles(units, triangles).facts()
    if not (facts.is_closed and facts.is_oriented):
        if face_bytes is None:
            raise ValueError("`rays` must surround the centre; got directions to one side of it")
        raise ValueError("`faces` must close around the centre; got some that leave gaps or overlap")
    return read_only(triangles)


def _general(corners: NDArray[np.float64], triangles: NDArray[np.int64]) -> tuple[float, NDArray[np.float64]]:
    kernel = kernel_of_halfspaces(HalfSpaces.from_mesh(TriangleMesh.from_triangles(corners, triangles)), None)
    if not len(kernel.vertices):
        return 0.0, np.zeros(6)
    return kernel.volume, np.concatenate([kernel.vertices.min(axis=0), kernel.vertices.max(axis=0)])
