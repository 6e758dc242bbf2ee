"""Two surfaces -> the rigid motion between them, through their relaxed kernels: `register`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from voxkernel._checks import as_depth, as_each, as_nonnegative, as_positive, read_only
from voxkernel._open3d import open3d
from voxkernel.exact import KernelPolytope
from voxkernel.measures import KernelMoments, kernel_points
from voxkernel.mesh import MeshLike, as_mesh
from voxkernel.registration.icp import Refine, icp
from voxkernel.registration.pair import SCORE_REACH, Solution, cropped_to_overlap, scaled, solve, to_local, to_world
from voxkernel.registration.prepare import PreparedSurface, prepare
from voxkernel.registration.refine import refined
from voxkernel.registration.result import Candidate, Registration
from voxkernel.registration.score import ScoredSurface, surface_score
from voxkernel.registration.search import ScoredCloud, frame_transforms, inverse
from voxkernel.voxels import KernelGrid

__all__ = [
    "Candidate",
    "Registration",
    "align_kernels",
    "as_margins",
    "frame_candidates",
    "prepare_surface",
    "refine_alignment",
    "register",
    "score_alignment",
]

_MARGINS = (0.06, 0.1, 0.15)
_KERNEL_REACH = 0.2  # of the larger kernel's diagonal
_REACH = 0.02  # default `max_distance`, of the larger diagonal


def register(
    source: MeshLike | PreparedSurface,
    target: MeshLike | PreparedSurface,
    *,
    margins: Sequence[float] | None = None,
    refine: Refine = "point_to_plane",
    max_distance: float | None = None,
    overlap_steps: int = 0,
) -> Registration:
    """Find the rigid motion that lays one surface on another, from any pose and without a first guess.

    Parameters
    ----------
    source, target : mesh, path, (vertices, faces) or PreparedSurface
        Anything `as_mesh` takes, or what `prepare_surface` made of it with the same margins. Facets of both
        must be turned the same way.
    margins : sequence of float, optional
        Margins of the relaxed kernels above the smallest violation, which is found to 2e-3, >= 0; they are computed
        in one traversal and the one whose motion fits the surfaces best wins. 0.06, 0.1 and 0.15 by default.
    refine : {"point_to_plane", "point_to_point", "none"}
        ICP on the surfaces after the kernels, or none.
    max_distance : float, optional
        How near is near, for `fitness` and `inlier_rmse`, mesh units; 2 % of the larger bounding-box diagonal by
        default. It does not change the motion.
    overlap_steps : int
        How often to crop both surfaces to where they overlap and register again, with the kernels of the
        cropped surfaces; 0 to 10. For surfaces that show different parts of one object.

    Returns
    -------
    Registration
        The motion, its fit, everything that was tried, and whether to doubt it.

    Raises
    ------
    MeshError, MeshReadError, TypeError
        If a surface cannot be used.
    ValueError
        If an option is out of range.

    Notes
    -----
    Kernels move with the surface [1]_, and relaxed kernels exist where scans have no kernel. A copy of each
    surface is smoothed and thinned; the principal frames of its relaxed kernels give motions, one for each
    proper choice of signs. Each is moved by a short ICP and scored on both surfaces; when none fits clearly, the
    frames of the surfaces and a net of 60 rotations about the kernels are tried too. The best are refined by ICP
    (Open3D). Nothing is random; ICP adds in parallel, so that the last digits may differ from run to run. The
    pair is ordered by area first, so that exchanging source and target gives the inverse motion.

    References
    ----------
    .. [1] N. Werghi, "The Discrete Surface Kernel: Framework and Applications", 2008, sections 2 and 5.

    Examples
    --------
    >>> import numpy as np
    >>> import voxkernel
    >>> from voxkernel.demo_shapes import face
    >>> target = voxkernel.as_mesh(face())
    >>> quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    >>> source = (target.vertices @ quarter.T, target.faces)
    >>> found = voxkernel.register(source, target)
    >>> bool(np.allclose(found.T_target_source[:3, :3], quarter.T, atol=1e-9)), found.ambiguous
    (True, False)
    """
    margins = as_margins(margins)
    if refine not in get_args(Refine):
        raise ValueError(f"`refine` must be one of {', '.join(map(repr, get_args(Refine)))}; got {refine!r}")
    near = None if max_distance is None else as_positive("max_distance", max_distance)
    steps = as_depth("overlap_steps", overlap_steps, 0, 10)
    one, two = (_prepared(name, s, margins) for name, s in (("source", source), ("target", target)))
    # The smaller surface is laid on the larger one, whichever of them is called the source.
    flipped = (one.area, len(one.faces)) > (two.area, len(two.faces))
    pair = (two, one) if flipped else (one, two)
    found = solve(pair, pair, refine)
    for _ in range(steps):
        cropped = cropped_to_overlap(pair, found.transform)
        if cropped is None:
            break
        again = solve(pair, cropped, refine)
        if again.score < found.score:
            break
        found = again
    return _wrapped(one, two, found, flipped, near)


def prepare_surface(surface: MeshLike, *, margins: Sequence[float] | None = None) -> PreparedSurface:
    """Do once what registration needs of a surface: samples, normals and relaxed kernels.

    Parameters
    ----------
    surface : mesh, path or (vertices, faces)
        Anything `as_mesh` takes.
    margins : sequence of float, optional
        As for `register`.

    Returns
    -------
    PreparedSurface
        For `register`, which takes it in place of the surface.

    Raises
    ------
    MeshError, MeshReadError, TypeError
        If the surface cannot be used.
    """
    return prepare(as_mesh(surface), as_margins(margins))


def frame_candidates(source: KernelMoments, target: KernelMoments) -> NDArray[np.float64]:
    """Give the motions that lay the principal frame of one kernel on that of another.

    Parameters
    ----------
    source, target : KernelMoments
        From `kernel_moments`.

    Returns
    -------
    (k, 4, 4) float64
        Proper rigid motions from source to target: four choices of signs; 16 turns where two spreads are within
        10 % of each other and 60 where all are, because the axes then say nothing. None for an empty kernel.
    """
    return frame_transforms(source, target)


def score_alignment(
    source: MeshLike | PreparedSurface, target: MeshLike | PreparedSurface, T_target_source: ArrayLike
) -> float:
    """Score how well a motion lays one surface on another.

    Parameters
    ----------
    source, target : mesh, path, (vertices, faces) or PreparedSurface
        The surfaces.
    T_target_source : (4, 4) array_like
        Rigid motion from source to target.

    Returns
    -------
    float
        In [0, 1]. Mean of `1 - (d / r)**2` over the area of both surfaces, `r` being 1/30 of the larger
        diagonal and d the distance to the triangles of the other surface; 0 beyond `r` or where the normals
        (of the smoothed surfaces) are more than 60 degrees apart. 1 is a perfect fit.

    Raises
    ------
    ValueError
        If the matrix is not a rigid motion.
    """
    one, two = (_prepared(n, s, ()) for n, s in (("source", source), ("target", target)))
    scale = max(one.diagonal, two.diagonal)
    local = scaled(to_local(one, two, _rigid(T_target_source)), 1.0 / scale)
    return surface_score(ScoredSurface(one, scale), ScoredSurface(two, scale), local, SCORE_REACH)


def refine_alignment(
    source: MeshLike | PreparedSurface,
    target: MeshLike | PreparedSurface,
    T_target_source: ArrayLike,
    *,
    method: Literal["point_to_plane", "point_to_point"] = "point_to_plane",
) -> tuple[NDArray[np.float64], bool]:
    """Improve a motion by ICP on the surfaces.

    Parameters
    ----------
    source, target : mesh, path, (vertices, faces) or PreparedSurface
        The surfaces.
    T_target_source : (4, 4) array_like
        First guess.
    method : {"point_to_plane", "point_to_point"}
        What ICP minimises.

    Returns
    -------
    T_target_source : (4, 4) float64
        The improved motion.
    converged : bool
        Whether it has come to rest.

    Raises
    ------
    ValueError
        If the matrix is not a rigid motion.
    """
    one, two = (_prepared(n, s, ()) for n, s in (("source", source), ("target", target)))
    scale = max(one.diagonal, two.diagonal)
    start = scaled(to_local(one, two, _rigid(T_target_source)), 1.0 / scale)
    found = refined(ScoredCloud(one.fine, scale), ScoredCloud(two.fine, scale), start, method)
    return to_world(one, two, scaled(found.transform, scale)), found.settled


def align_kernels(
    source: KernelPolytope | KernelGrid, target: KernelPolytope | KernelGrid, T_target_source: ArrayLike
) -> tuple[NDArray[np.float64], bool]:
    """Improve a motion by point-to-point ICP on the boundaries of two kernels.

    Parameters
    ----------
    source, target : KernelPolytope or KernelGrid
        The kernels.
    T_target_source : (4, 4) array_like
        First guess, such as one of `frame_candidates`.

    Returns
    -------
    T_target_source : (4, 4) float64
        The improved motion; the first guess where a kernel is empty.
    converged : bool
        Whether it has come to rest on pairs of points.

    Raises
    ------
    ValueError
        If the matrix is not a rigid motion.
    """
    start = _rigid(T_target_source)
    clouds = [kernel_points(k).boundary for k in (source, target)]
    if not all(len(c) for c in clouds):
        return start, False
    geometry = open3d()
    scale = max(float(np.linalg.norm(np.ptp(c, axis=0))) for c in clouds) or 1.0
    shifts = [c.mean(axis=0) for c in clouds]
    one, two = (
        geometry.geometry.PointCloud(geometry.utility.Vector3dVector((c - s) / scale))
        for c, s in zip(clouds, shifts, strict=True)
    )
    local = start.copy()
    local[:3, 3] = (start[:3, 3] + start[:3, :3] @ shifts[0] - shifts[1]) / scale
    found = icp(one, two, local, _KERNEL_REACH, "point_to_point", steps=60, change=1e-9)
    after = icp(one, two, found.transform, _KERNEL_REACH, "point_to_point", steps=1, change=1e-15)
    motion = found.transform.copy()
    motion[:3, 3] = motion[:3, 3] * scale + shifts[1] - motion[:3, :3] @ shifts[0]
    return motion, found.n_pairs > 3 and abs(after.rmse - found.rmse) < 1e-6


def _wrapped(
    one: PreparedSurface, two: PreparedSurface, found: Solution, flipped: bool, near: float | None
) -> Registration:
    """Turn a solution the way it was asked for and measure its fit on the surfaces."""
    reach = _REACH * max(one.diagonal, two.diagonal) if near is None else near

    def turned(motion: NDArray[np.float64]) -> NDArray[np.float64]:
        return read_only(inverse(motion) if flipped else motion.copy())

    candidates = tuple(
        Candidate(turned(g.transform), g.origin, g.margin, g.score, g.moved_score) for g in found.guesses
    )
    motion = turned(found.transform)
    scale = max(one.diagonal, two.diagonal)
    local = scaled(to_local(one, two, motion), 1.0 / scale)
    shown = found.surfaces[::-1] if flipped else found.surfaces
    fitness, rmse = shown[0].fit(shown[1], local, reach / scale)
    rmse *= scale
    first = motion if found.by_kernels is None else turned(found.by_kernels.transform)
    return Registration(
        motion, first, fitness, rmse, found.score, reach, float("nan") if found.guess is None else found.guess.margin,
        candidates, found.converged, found.ambiguous, found.reason,
    )  # fmt: skip


def as_margins(margins: Any) -> tuple[float, ...]:
    """Check the margins; they are used in ascending order."""
    return _MARGINS if margins is None else tuple(sorted(set(as_each("margins", margins, as_nonnegative))))


def _prepared(name: str, surface: MeshLike | PreparedSurface, margins: tuple[float, ...]) -> PreparedSurface:
    if not isinstance(surface, PreparedSurface):
        return prepare(as_mesh(surface), margins)
    if margins and surface.margins != margins:
        raise ValueError(f"`{name}` must be prepared with the margins {margins}; got {surface.margins}")
    return surface


def _rigid(T_target_source: ArrayLike) -> NDArray[np.float64]:
    """Check that a matrix is a proper rigid motion."""
    motion = np.array(T_target_source, dtype=np.float64)
    if motion.shape != (4, 4):
        raise ValueError(f"`T_target_source` must have shape (4, 4); got {motion.shape}")
    turn = motion[:3, :3]
    good = np.isfinite(motion).all() and np.allclose(turn @ turn.T, np.eye(3), atol=1e-6) and np.linalg.det(turn) > 0
    if not (good and np.array_equal(motion[3], [0, 0, 0, 1])):
        raise ValueError("`T_target_source` must be a rotation and a shift; got a matrix that is not")
    return motion
