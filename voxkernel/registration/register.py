"""Two surfaces -> the rigid motion between them, through their relaxed kernels: `register`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from voxkernel._checks import as_depth, as_each, as_nonnegative, as_positive, read_only
from voxkernel.exact import KernelPolytope
from voxkernel.measures import KernelMoments, kernel_points
from voxkernel.mesh import MeshLike, as_mesh
from voxkernel.registration.evidence import fit_of
from voxkernel.registration.icp import Refine, icp
from voxkernel.registration.last import last_refined
from voxkernel.registration.motions import scaled, to_local, to_world
from voxkernel.registration.other_ways import facets_turned, fitting_size, resized, size_ratios
from voxkernel.registration.pair import SCORE_REACH, Solution, cropped_to_overlap, solve
from voxkernel.registration.polish import polished
from voxkernel.registration.prepare import PreparedSurface, prepare
from voxkernel.registration.result import Candidate, Registration
from voxkernel.registration.score import fit_within, surface_score
from voxkernel.registration.search import frame_transforms, inverse
from voxkernel.registration.side import Side
from voxkernel.registration.verdict import NAMES, NO_MATCH, verdict_of
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

DEFAULT_MARGINS = (0.06, 0.1, 0.15)
_KERNEL_REACH = 0.2  # of the larger kernel's diagonal
_CLEAR = 0.95  # a probability above which no other size is tried
_SIZE_STEPS = 4
_EXACT_SIZE = 1e-5  # logarithm of a change of size that is not worth another step
_REACH = 0.02  # default `max_distance`, of the larger diagonal
_SAMPLES = 2000
_WIDE, _NEAR, _LEAST, _STEPS = 1 / 16, 1 / 45, 1 / 300, 60  # of `refine_alignment`: reaches, shares of the diagonal


class _Answer(NamedTuple):
    """A solution, whether source and target were exchanged for it, and what was done to make it fit."""

    found: Solution
    flipped: bool
    facets_turned: bool
    other_size: float | None


def register(
    source: MeshLike | PreparedSurface,
    target: MeshLike | PreparedSurface,
    *,
    margins: Sequence[float] | None = None,
    refine: Refine = "point_to_plane",
    max_distance: float | None = None,
    overlap_steps: int = 0,
    estimate_scale: bool = False,
) -> Registration:
    """Find the rigid motion that lays one surface on another, from any pose and without a first guess.

    Parameters
    ----------
    source, target : mesh, path, (vertices, faces) or PreparedSurface
        Anything `as_mesh` takes, or what `prepare_surface` made of it with the same margins. Where nothing fits,
        the facets of one are turned over, and `facets_turned` says so.
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
    estimate_scale : bool
        Whether the surfaces may be of different size. The answer is then a similarity: `T_target_source` holds the
        `scale`, the size of the target over that of the source. Otherwise a scale that fits is told in the reason.

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
    surface of at most 20,000 facets is smoothed and thinned; the principal frames of its relaxed kernels give
    motions, one for each proper choice of signs. When none fits clearly, local features [2]_ that agree with each
    other [3]_, the kernels of parts, the frames of the surfaces and a net of 60 rotations give more. All are refined
    by ICP with Tukey's loss and judged by what they explain of both surfaces and what contradicts them; one that is
    believed goes before one that explains more. Only the last ICP sees the surfaces at full resolution, where they
    overlap. Nothing is random and sums keep one order. The pair is put in the order of areas first, so that
    exchanging source and target gives the inverse motion; coordinates in units of the larger diagonal are rounded to
    2^-32 before anything is decided by them, so that another unit of length changes nothing.

    References
    ----------
    .. [1] N. Werghi, "The Discrete Surface Kernel: Framework and Applications", 2008, sections 2 and 5.
    .. [2] R. B. Rusu et al., "Fast point feature histograms (FPFH) for 3D registration", ICRA 2009.
    .. [3] Z. Chen et al., "SC2-PCR: a second order spatial compatibility for efficient and robust point cloud
       registration", CVPR 2022.

    Examples
    --------
    >>> import numpy as np
    >>> import voxkernel
    >>> from voxkernel.demo_shapes import face
    >>> target = voxkernel.as_mesh(face())
    >>> quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    >>> source = (target.vertices @ quarter.T, target.faces)
    >>> found = voxkernel.register(source, target)
    >>> bool(np.allclose(found.T_target_source[:3, :3], quarter.T, atol=1e-9)), found.verdict
    (True, 'right')
    """
    margins = as_margins(margins)
    if refine not in get_args(Refine):
        raise ValueError(f"`refine` must be one of {', '.join(map(repr, get_args(Refine)))}; got {refine!r}")
    near = None if max_distance is None else as_positive("max_distance", max_distance)
    steps = as_depth("overlap_steps", overlap_steps, 0, 10)
    one, two = (_prepared(name, s, margins) for name, s in (("source", source), ("target", target)))
    if estimate_scale:
        return _with_scale(one, two, refine, steps, near)
    return _wrapped(one, two, _answer(one, two, refine, steps, other_sizes=True), near)


def _answer(one: PreparedSurface, two: PreparedSurface, refine: Refine, steps: int, *, other_sizes: bool) -> _Answer:
    """Solve a pair, the smaller surface laid on the larger one, whichever of them is called the source."""
    flipped = _order_of(one) > _order_of(two)
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
    over = facets_turned(pair, found, refine)
    if over is not None:
        return _Answer(over, flipped, True, None)
    size = None if found.judged.other_size == 1.0 else found.judged.other_size
    if size is None and other_sizes and found.judged.probability < NO_MATCH:
        size = fitting_size(pair, refine)
    return _Answer(found, flipped, False, size if size is None or not flipped else 1.0 / size)


def _order_of(surface: PreparedSurface) -> tuple[float, int, bytes]:
    """What puts the two surfaces of a pair in one order, whichever of them is called the source."""
    return surface.area, len(surface.faces), surface.mesh.vertices.tobytes()


def _with_scale(
    one: PreparedSurface, two: PreparedSurface, refine: Refine, steps: int, near: float | None
) -> Registration:
    """Solve with the source at every size that kernels, area and diagonal suggest, then improve the best size."""
    tried: list[tuple[float, PreparedSurface, _Answer]] = []
    for ratio in size_ratios(one, two):
        grown = resized(one, ratio)
        tried.append((ratio, grown, _answer(grown, two, refine, steps, other_sizes=False)))
        if tried[-1][2].found.judged.probability > _CLEAR:
            break
    ratio, grown, answer = max(tried, key=_fits)
    for _ in range(_SIZE_STEPS):
        change = answer.found.judged.size if not answer.flipped else 1.0 / answer.found.judged.size
        if not _EXACT_SIZE < abs(np.log(change)) < 0.3:
            break
        next_grown = resized(one, ratio * change)
        again = _answer(next_grown, two, refine, steps, other_sizes=False)
        if again.found.score < answer.found.score:
            break
        ratio, grown, answer = ratio * change, next_grown, again
    return _wrapped(grown, two, answer, near, ratio)


def _fits(entry: tuple[float, PreparedSurface, _Answer]) -> tuple[float, float]:
    return entry[2].found.judged.probability, entry[2].found.score


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
    sides = Side(one.skin, scale, _SAMPLES), Side(two.skin, scale, _SAMPLES)
    return surface_score(*sides, fit_of(*sides, local, SCORE_REACH), SCORE_REACH)


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
    sides = Side(one.skin, scale, _SAMPLES), Side(two.skin, scale, _SAMPLES)
    found = polished(*sides, start, reach=_WIDE, least=_LEAST, steps=_STEPS)
    motion, rests = last_refined((one, two), sides, found, _NEAR, method)
    return to_world(one, two, scaled(motion, scale)), rests


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
    scale = max(float(np.linalg.norm(np.ptp(c, axis=0))) for c in clouds) or 1.0
    shifts = [c.mean(axis=0) for c in clouds]
    one, two = ((c - s) / scale for c, s in zip(clouds, shifts, strict=True))
    local = start.copy()
    local[:3, 3] = (start[:3, 3] + start[:3, :3] @ shifts[0] - shifts[1]) / scale
    found = icp(one, two, local, _KERNEL_REACH, steps=60, change=1e-9)
    after = icp(one, two, found.transform, _KERNEL_REACH, steps=1, change=1e-15)
    motion = found.transform.copy()
    motion[:3, 3] = motion[:3, 3] * scale + shifts[1] - motion[:3, :3] @ shifts[0]
    return motion, found.n_pairs > 3 and abs(after.rmse - found.rmse) < 1e-6


def _wrapped(
    one: PreparedSurface, two: PreparedSurface, answer: _Answer, near: float | None, scale: float = 1.0
) -> Registration:
    """Turn an answer the way it was asked for and measure its fit on the surfaces."""
    found = answer.found
    size = max(one.diagonal, two.diagonal)
    reach = _REACH * size if near is None else near

    def turned(motion: NDArray[np.float64]) -> NDArray[np.float64]:
        there = inverse(motion) if answer.flipped else motion.copy()
        there[:3, :3] *= scale
        return read_only(there)

    candidates = tuple(
        Candidate(turned(g.transform), g.origin, g.margin, g.score, g.moved_score) for g in found.guesses
    )
    fitness, rmse = fit_within(found.sides[answer.flipped], found.fit.distances[answer.flipped], reach / size)
    motion = turned(found.transform)
    first = motion if found.by_kernels is None else turned(found.by_kernels.transform)
    verdict = verdict_of(found.judged.probability, doubted=found.ambiguous or not found.converged)
    reason = found.reason
    if answer.other_size is not None:
        reason = f"the surfaces fit each other at a scale of {answer.other_size:.3g}, and not as they are"
    elif verdict == "no match" and not reason:
        reason = "no motion that was tried explains enough of the surfaces without contradiction"
    elif verdict == "uncertain" and not reason:
        reason = f"the fit is neither clearly right nor clearly wrong (probability {found.judged.probability:.2f})"
    return Registration(
        motion, first, fitness, rmse * size, found.score, reach,
        float("nan") if found.guess is None else found.guess.margin, candidates, found.converged, found.ambiguous,
        reason, verdict, found.judged.probability, scale, "" if found.guess is None else found.guess.origin,
        answer.facets_turned, dict(zip(NAMES, found.judged.numbers.tolist(), strict=True)),
    )  # fmt: skip


def as_margins(margins: Any) -> tuple[float, ...]:
    """Check the margins; they are used in ascending order."""
    return DEFAULT_MARGINS if margins is None else tuple(sorted(set(as_each("margins", margins, as_nonnegative))))


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
