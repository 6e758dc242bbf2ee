"""How star-shaped a surface is: verdict, volume ratio, centre and proof."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import chain
from math import fsum
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel._checks import as_choice, as_positive
from voxkernel._frozen import Frozen
from voxkernel._plain import plain
from voxkernel.exact import Certificate, KernelPolytope, kernel_of_halfspaces
from voxkernel.exact.convexity import is_locally_convex
from voxkernel.exact.exact_kernel import kernel_of_stream
from voxkernel.guarding import Guards, guards
from voxkernel.halfspaces import Domain, HalfSpaces
from voxkernel.halfspaces.surface_arguments import EXACT, SurfaceArgument, surface_argument
from voxkernel.large import StreamedSurface
from voxkernel.large.stream_mesh import reader_of
from voxkernel.large.streamed_planes import StreamedPlanes
from voxkernel.large.surface_reader import SurfaceReader
from voxkernel.measures.defect_profile import PROFILE_DEPTH, DefectProfile, profile_of_planes, profile_of_stream
from voxkernel.measures.streamed_convexity import lies_in_kernel
from voxkernel.measures.visibility import VisibleFraction, visible_fraction, visible_of_stream
from voxkernel.mesh import MeshLike, TriangleMesh, as_mesh
from voxkernel.relaxed import StarCenter
from voxkernel.relaxed.best_center import center_of_planes
from voxkernel.relaxed.facet_weights import weigh
from voxkernel.relaxed.streamed_center import center_of_stream
from voxkernel.relaxed.streamed_violation import relaxed_region

__all__ = ["Starshapeness", "starshapeness"]

_GAP = 1e-4
_TOLERANCES = (0.01, 0.03, 0.1)

Verdict = Literal["star-shaped", "degenerate", "not star-shaped"]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Starshapeness(Frozen):
    """Whether and how much a surface is star-shaped.

    Attributes
    ----------
    verdict : {"star-shaped", "degenerate", "not star-shaped"}
        "degenerate" is a kernel without volume: a point, a segment or a flat polygon. The verdict
        is about the surface alone, never about the domain.
    ratio : float
        Kernel volume over `reference_volume`, in [0, 1]; exactly 1 for convex closed shapes; NaN
        where the reference volume is not positive.
    volume, volume_bounds : float and (float, float)
        Kernel volume, mesh units cubed, inside the domain where there is one.
    reference : {"enclosed volume", "domain volume"}
        What the ratio divides by: the enclosed volume of surfaces that bound one, else the domain's.
    reference_volume : float
        Mesh units cubed.
    dimension : int
        Dimension of the kernel without the domain, -1 to 3.
    center : (3,) float64 or None
        Deepest point of the kernel; None when it is empty.
    clearance : float
        Distance of the centre from the nearest facet plane; NaN when empty.
    certificate : Certificate
        Proof of `dimension`.
    reason : str
        Why the surface is not star-shaped; "" when it is.
    notes : tuple of str
        What a reader should know about the input, such as facets that point inwards.
    n_facets, n_degenerate : int
        Facets in use, and facets without area that were left out.
    is_closed : bool
        Whether every edge is traversed equally often in both directions.
    kernel : KernelPolytope
        The kernel inside the domain.
    violation_bounds : (float, float)
        Certain bounds on the smallest share of the area that a point of the domain does not face; (0, 0)
        when the kernel inside the domain is not empty. Ranks surfaces that are not star-shaped.
    star_center : (3,) float64
        The point that faces the most of the surface, as `best_center`; the kernel's deepest point if any.
    visible : VisibleFraction or None
        What is really visible from there; None unless asked for.
    profile : DefectProfile or None
        Volume shares of the relaxed kernels for a few tolerances; None unless asked for.
    guards : Guards or None
        Few points that see 99 % of the area, as `guards` finds them; None unless asked for.
    """

    verdict: Verdict
    ratio: float
    volume: float
    volume_bounds: tuple[float, float]
    reference: Literal["enclosed volume", "domain volume"]
    reference_volume: float
    dimension: int
    center: NDArray[np.float64] | None
    clearance: float
    certificate: Certificate
    reason: str
    notes: tuple[str, ...]
    n_facets: int
    n_degenerate: int
    is_closed: bool
    kernel: KernelPolytope
    violation_bounds: tuple[float, float]
    star_center: NDArray[np.float64]
    visible: VisibleFraction | None
    profile: DefectProfile | None
    guards: Guards | None = None

    def __repr__(self) -> str:
        """Name verdict, ratio and volume, and the defect where there is one."""
        low, high = self.violation_bounds
        defect = f", violation_bounds=({low:.6g}, {high:.6g})" if high else ""
        return f"Starshapeness({self.verdict!r}, ratio={self.ratio:.6g}, volume={self.volume:.6g}{defect})"

    def to_dict(self) -> dict[str, Any]:
        """Give everything but the polytope as plain numbers, ready for JSON; NaN becomes None."""
        return plain({
            "verdict": self.verdict,
            "ratio": self.ratio,
            "volume": self.volume,
            "volume_bounds": self.volume_bounds,
            "reference": self.reference,
            "reference_volume": self.reference_volume,
            "dimension": self.dimension,
            "center": self.center,
            "clearance": self.clearance,
            "certificate": self.certificate.to_dict(),
            "reason": self.reason,
            "notes": self.notes,
            "n_facets": self.n_facets,
            "n_degenerate": self.n_degenerate,
            "is_closed": self.is_closed,
            "domain": None if self.kernel.domain is None else self.kernel.domain.kind,
            "cut_by_domain": self.kernel.cut_by_domain,
            "is_bounded": self.kernel.is_bounded,
            "violation_bounds": self.violation_bounds,
            "star_center": self.star_center,
            "visible": None if self.visible is None else self.visible.to_dict(),
            "profile": None if self.profile is None else self.profile.to_dict(),
            "guards": None if self.guards is None else self.guards.to_dict(),
        })


def starshapeness(
    surface: MeshLike | StreamedSurface,
    *,
    facets: Any = None,
    domain: Any = None,
    gap: float = _GAP,
    detail: bool | Literal["guards"] = False,
) -> Starshapeness:
    """Classify a surface as star-shaped or not and score it by its kernel's volume.

    Parameters
    ----------
    surface : mesh, path, (vertices, faces) or StreamedSurface
        Anything `as_mesh` takes, facets counter-clockwise seen from outside; or a surface of `stream_mesh`.
    facets : int array or bool mask, optional
        Restrict the surface to these facets.
    domain : {"ball", "hull", "box"}, Domain, HalfSpaces or (normals, offsets), optional
        Where the kernel's volume is measured; none for surfaces that bound a volume and "ball" for
        open ones by default.
    gap : float
        Largest distance of the bounds on the smallest violation, as for `best_center`, > 0.
    detail : bool or "guards"
        Compute `visible`, for which rays are cast with Open3D, and `profile`, for tolerances of 0.01, 0.03
        and 0.1, as well; "guards": `guards` only, not of a streamed surface, as they need all of its
        triangles at once, in memory.

    Returns
    -------
    Starshapeness
        A surface that is not star-shaped is a result, not an error.

    Raises
    ------
    MeshError, MeshReadError, TypeError, ValueError
        As `exact_kernel`.

    Notes
    -----
    A surface is star-shaped iff its kernel is not empty [1]_. The verdict is exact for the float64
    coordinates given and comes with a certificate.

    References
    ----------
    .. [1] N. Werghi, "The Discrete Surface Kernel: Framework and Applications", 2008.

    Examples
    --------
    >>> import voxkernel
    >>> tetrahedron = ([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    >>> score = voxkernel.starshapeness(tetrahedron)
    >>> score.verdict, score.ratio
    ('star-shaped', 1.0)
    """
    if isinstance(detail, str):
        as_choice("detail", detail, ("guards",))
    share = as_positive("gap", gap)
    if isinstance(surface, StreamedSurface):
        if detail == "guards":
            raise ValueError("`detail` must be True or False for a stream, as guards need all of it; got 'guards'")
        return _of_stream(reader_of(surface, facets), domain, share, bool(detail))
    mesh = as_mesh(surface, facets=facets)
    return score_of_planes(mesh, surface_argument(mesh), domain, share, detail=detail)


def score_of_planes(
    mesh: TriangleMesh, argument: SurfaceArgument, domain: Any, share: float, *,
    detail: bool | Literal["guards"] = False, threads: int = 1,
) -> Starshapeness:  # fmt: skip
    """Score a mesh whose half-spaces are there already."""
    halfspaces, region = argument.halfspaces, argument.domain(domain, EXACT)
    kernel = kernel_of_halfspaces(halfspaces, region, threads=threads)
    known = _Known(
        len(halfspaces), halfspaces.n_degenerate, halfspaces.bounds_volume,
        fsum(_thirds(halfspaces)) * halfspaces.scale / 3.0,
        partial(_depth, halfspaces),
        lambda: is_locally_convex(mesh, halfspaces),
    )  # fmt: skip
    if kernel.dimension >= 0:
        star = StarCenter(kernel.deepest_point, (0.0, 0.0), region, 0, "")
    else:
        star = center_of_planes(weigh(halfspaces), argument, region, share)
    extra = _detail(argument, mesh, region, star.point) if detail and detail != "guards" else (None, None)
    return _scored(known, kernel, star, extra, guards(mesh) if detail == "guards" else None)


class _Known(NamedTuple):
    """What a score needs to know of a surface: numbers of facets, its volume, the depth of a point, convexity."""

    n_facets: int
    n_degenerate: int
    is_closed: bool
    volume: float
    depth: Callable[[NDArray[np.float64]], float]
    is_convex: Callable[[], bool]


def _thirds(halfspaces: HalfSpaces) -> list[float]:
    """Parts of three times the enclosed volume, by the divergence theorem with the facet planes; local offsets."""
    return (halfspaces.local_offsets * halfspaces.weights).tolist()


def _of_stream(reader: SurfaceReader, domain: Any, gap: float, detail: bool) -> Starshapeness:
    """Score a stream; it is convex if its kernel holds all of its corners."""
    kernel, planes = kernel_of_stream(reader, domain), StreamedPlanes(reader)
    parts = (_thirds(part) for _, part in planes.parts("volume"))

    def depth(center: NDArray[np.float64]) -> float:
        return min(_depth(part, center) for _, part in planes.parts("depth"))

    known = _Known(
        planes.n_facet_planes, len(planes.facts.degenerate), reader.bounds_volume,
        fsum(chain.from_iterable(parts)) * planes.scale / 3.0,
        depth,
        lambda: lies_in_kernel(reader, kernel),
    )  # fmt: skip
    star = center_of_stream(reader, kernel, domain, "area", gap, 0.0, center_of_planes)
    if not detail:
        return _scored(known, kernel, star, (None, None), None)
    region = relaxed_region(reader, kernel.domain)
    profile = profile_of_stream(reader, region, np.array(_TOLERANCES), PROFILE_DEPTH)
    return _scored(known, kernel, star, (visible_of_stream(reader, star.point), profile), None)


def _depth(halfspaces: HalfSpaces, center: NDArray[np.float64]) -> float:
    return float((halfspaces.offsets - halfspaces.normals @ center).min())


def _scored(
    known: _Known,
    kernel: KernelPolytope,
    star: StarCenter,
    extra: tuple[VisibleFraction, DefectProfile] | tuple[None, None],
    few: Guards | None,
) -> Starshapeness:
    """Put a score together."""
    region, notes = kernel.domain, _notes(known, kernel)
    certificate, center, clearance = kernel.certificate, kernel.deepest_point, kernel.clearance
    dimension = kernel.unclipped_dimension
    if kernel.dimension != dimension:  # the domain changed the answer: the proof is about the surface alone
        certificate = kernel.unclipped_certificate
        if kernel.unclipped_point is not None:
            center = kernel.unclipped_point
            clearance = max(0.0, known.depth(center))
    closed = known.is_closed
    reference_volume = known.volume if closed else (region.volume if region is not None else float("nan"))
    ratio = kernel.volume / reference_volume if reference_volume > 0 else (0.0 if dimension < 3 else float("nan"))
    if ratio > 1.0 - 1e-9:
        # Locally convex at every edge and wound once (the volumes agree) is convex.
        ratio = 1.0 if not closed or known.is_convex() else min(ratio, float(np.nextafter(1.0, 0.0)))
    return Starshapeness(
        "star-shaped" if dimension == 3 else "degenerate" if dimension >= 0 else "not star-shaped",
        ratio, kernel.volume, kernel.volume_bounds, "enclosed volume" if closed else "domain volume",
        reference_volume, dimension, None if dimension < 0 else center, clearance, certificate,
        _reason(dimension, certificate), notes, known.n_facets, known.n_degenerate, closed, kernel,
        star.violation_bounds, star.point, *extra, few,
    )  # fmt: skip


def _detail(
    surface: SurfaceArgument, mesh: TriangleMesh, domain: Domain | None, point: NDArray[np.float64]
) -> tuple[VisibleFraction, DefectProfile]:
    """Cast rays from the star centre and measure a few relaxed kernels."""
    planes, region = weigh(surface.halfspaces), surface.bounded_domain(domain)
    profile = profile_of_planes(planes, surface, region, np.array(_TOLERANCES), PROFILE_DEPTH, 1)
    return visible_fraction(mesh, point), profile


def _notes(known: _Known, kernel: KernelPolytope) -> tuple[str, ...]:
    notes: list[str] = []
    if known.n_degenerate:
        notes.append(f"{known.n_degenerate} facets without area left out")
    if not known.is_closed:
        notes.append("surface is open or not consistently oriented")
    elif known.volume < 0:
        notes.append("facets point inwards: the enclosed volume is negative; repair(mesh, orient=True) turns them")
    if kernel.unclipped_dimension >= 0 and kernel.dimension < kernel.unclipped_dimension:
        where = "outside" if kernel.dimension < 0 else "on the rim of"
        notes.append(f"the kernel lies {where} the domain, near {_format(kernel.unclipped_point)}")
    elif kernel.cut_by_domain:
        notes.append("the domain cuts the kernel" + ("" if kernel.is_bounded else ", which is unbounded"))
    return tuple(notes)


def _reason(dimension: int, certificate: Certificate) -> str:
    ids = ", ".join(map(str, certificate.facet_ids))
    if dimension < 0:
        return f"no point is on the inner side of facets {ids} at once"
    if dimension < 3:
        return f"the kernel is only a {('point', 'segment', 'flat polygon')[dimension]}, held by facets {ids}"
    return ""


def _format(point: NDArray[np.float64] | None) -> str:
    return "?" if point is None else "(" + ", ".join(f"{v:.4g}" for v in point) + ")"
