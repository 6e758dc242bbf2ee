"""A star-shaped surface as a function on the sphere, and the best centre for it: `spherical_map`."""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from voxkernel._checks import as_depth, as_nonnegative, as_points, read_only
from voxkernel._core import directions_and_radii
from voxkernel._frozen import Frozen
from voxkernel._plain import plain
from voxkernel.exact import KernelPolytope, kernel_of_halfspaces
from voxkernel.halfspaces import Domain, HalfSpaces
from voxkernel.halfspaces.predicates import exact_slacks, planes_not_clear
from voxkernel.halfspaces.surface_arguments import EXACT, surface_argument
from voxkernel.mesh import MeshLike, TriangleMesh, as_mesh
from voxkernel.relaxed import best_center
from voxkernel.spherical.boundary_angle import Boundary, agrees_with_boundary, facet_sides, solid_angles
from voxkernel.spherical.coverage import CoverageCertificate, coverage_optimum, distortion_optimum
from voxkernel.spherical.harmonics import MAX_DEGREE, Harmonics
from voxkernel.spherical.radial_grid import RadialGrid, ReconstructionError, reconstruction_error, sample_radii
from voxkernel.spherical.search_region import kernel_region
from voxkernel.spherical.sphere_grids import GridKind

__all__ = ["CENTERS", "SphericalMap", "spherical_map"]

CENTERS = ("coverage", "deepest", "centroid", "distortion", "relaxed")
Center = Literal["coverage", "deepest", "centroid", "distortion", "relaxed"] | ArrayLike


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class SphericalMap(Frozen):
    """A surface projected on the unit sphere around a centre.

    Attributes
    ----------
    mesh : TriangleMesh
        The surface.
    center : (3,) float64
        World coordinates.
    center_kind : {"coverage", "deepest", "centroid", "distortion", "relaxed", "point"}
        How the centre was chosen.
    solid_angle : float
        Signed solid angle of the surface seen from the centre, steradian: each triangle counts by its van Oosterom
        and Strackee formula, negative where it is seen from outside. 4 pi inside a closed surface.
    directions : (n, 3) float64
        Unit vector from the centre to each vertex; NaN for a vertex at the centre.
    radii : (n,) float64
        Distance of each vertex from the centre, mesh units.
    triangle_angles : (m,) float64
        Signed solid angle of each triangle, steradian.
    hidden_fraction : float
        Share of the area in facets that do not face the centre; exactly 0 for every kernel point. What is
        behind other facets is not counted: a lower bound for what cannot be seen.
    hidden_angle_fraction : float
        1 - solid angle / sum of the triangles' sizes: the share of the projected surface that lies over or under
        itself when each fold is counted; 0 for every kernel point.
    folded_facets : (k,) int64
        Ids of the facets that do not face the centre, exact for the doubles given.
    clearance : float
        Distance of the centre from the nearest facet plane, mesh units; negative outside the kernel.
    distortion : float
        Standard deviation over the area of solid angle per area, relative to its mean: 0 where every piece of
        surface gets its share of the sphere.
    certificate : CoverageCertificate or None
        Why no kernel point near a "coverage" centre sees more; None for other centres and closed surfaces.
    kernel : KernelPolytope or None
        The kernel the centre was chosen from; None for "relaxed" and for a given point.
    notes : tuple of str
        What a reader should know about the centre.
    """

    mesh: TriangleMesh
    center: NDArray[np.float64]
    center_kind: str
    solid_angle: float
    directions: NDArray[np.float64]
    radii: NDArray[np.float64]
    triangle_angles: NDArray[np.float64]
    hidden_fraction: float
    hidden_angle_fraction: float
    folded_facets: NDArray[np.int64]
    clearance: float
    distortion: float
    certificate: CoverageCertificate | None
    kernel: KernelPolytope | None
    notes: tuple[str, ...]

    def __repr__(self) -> str:
        """Name the centre, coverage and what is hidden."""
        place = ", ".join(f"{v:.6g}" for v in self.center)
        return (
            f"SphericalMap(center=({place}), coverage={self.coverage:.4g}, hidden_fraction={self.hidden_fraction:.4g})"
        )

    @property
    def coverage(self) -> float:
        """Solid angle as a share of the whole sphere."""
        return self.solid_angle / (4.0 * np.pi)

    @property
    def triangles(self) -> NDArray[np.int64]:
        """Spherical triangles: three rows of `directions` each, (m, 3)."""
        return self.mesh.faces

    def sample(self, *, grid: GridKind = "equiangular", n: int = 128) -> RadialGrid:
        """Measure the radius along every direction of a grid.

        Parameters
        ----------
        grid : {"equiangular", "gauss-legendre", "healpix"}
            Centres of n by 2 n cells; n Gauss-Legendre colatitudes by 2 n longitudes; 12 n^2 equal pixels.
        n : int
            Resolution, 1 to 8192.

        Returns
        -------
        RadialGrid
            Radii, NaN where the surface is not seen.

        Raises
        ------
        ValueError
            If `grid` or `n` cannot be used.

        Notes
        -----
        Open3D casts the rays in single precision; the radius is computed in double precision from the plane of
        the triangle that the ray really passes, so it is exact up to rounding inside triangles. The first facet
        counts where the surface lies over itself.
        """
        return sample_radii(self.mesh, self.center, grid, n)

    def reconstruct(self, *, grid: GridKind = "equiangular", n: int = 128) -> TriangleMesh:
        """Make a surface of the radii on a grid; see `sample` and `RadialGrid.reconstruct`.

        Parameters
        ----------
        grid, n
            As for `sample`.

        Returns
        -------
        TriangleMesh
            In world coordinates.
        """
        return self.sample(grid=grid, n=n).reconstruct()

    def error(self, reconstruction: TriangleMesh) -> ReconstructionError:
        """Measure a reconstruction against the surface.

        Parameters
        ----------
        reconstruction : TriangleMesh
            What `reconstruct` gave.

        Returns
        -------
        ReconstructionError
            `hausdorff` and `rms`, mesh units, both ways.

        Notes
        -----
        For a smooth surface seen completely both fall with 1 / n^2 until the facets of the input show; where it
        has edges the Hausdorff distance falls with 1 / n, and so it does at the rim of an open surface.
        """
        return reconstruction_error(self.mesh, reconstruction)

    def harmonics(self, degree: int = 64, *, n: int | None = None, regularisation: float | None = None) -> Harmonics:
        """Expand the radius in spherical harmonics, over the seen part only where the surface is open.

        Parameters
        ----------
        degree : int
            Largest degree, 0 to 256.
        n : int, optional
            Gauss-Legendre rings to sample on, more than `degree`; twice `degree` + 2 by default.
        regularisation : float, optional
            As for `RadialGrid.harmonics`.

        Returns
        -------
        Harmonics
            Coefficients and energies per degree.

        Raises
        ------
        ValueError
            If `degree` or `n` cannot be used.
        """
        top = as_depth("degree", degree, 0, MAX_DEGREE)
        rings = 2 * top + 2 if n is None else as_depth("n", n, top + 1, 8192)
        return self.sample(grid="gauss-legendre", n=rings).harmonics(top, regularisation=regularisation)

    def to_dict(self) -> dict[str, Any]:
        """Give what is measured at the centre as plain numbers, ready for JSON; NaN becomes None."""
        proof = self.certificate
        return plain({
            "center": self.center,
            "center_kind": self.center_kind,
            "solid_angle": self.solid_angle,
            "coverage": self.coverage,
            "clearance": self.clearance,
            "distortion": self.distortion,
            "hidden_fraction": self.hidden_fraction,
            "hidden_angle_fraction": self.hidden_angle_fraction,
            "folded_facets": self.folded_facets,
            "certificate": None
            if proof is None
            else {
                "gradient": proof.gradient,
                "active_facets": proof.active_facets,
                "multipliers": proof.multipliers,
                "residual": proof.residual,
                "curvature": proof.curvature,
                "n_starts": proof.n_starts,
                "n_optima": proof.n_optima,
                "runner_up": proof.runner_up,
                "touches_boundary": proof.touches_boundary,
            },
            "notes": self.notes,
        })


def spherical_map(
    surface: MeshLike,
    *,
    center: Center = "coverage",
    clearance: float = 0.0,
    domain: Any = None,
    facets: Any = None,
) -> SphericalMap:
    """Project a surface on the sphere around a point from which all of it can be seen.

    Parameters
    ----------
    surface : mesh, path or (vertices, faces)
        Anything `as_mesh` takes, facets counter-clockwise seen from outside.
    center : {"coverage", "deepest", "centroid", "distortion", "relaxed"} or (3,) array_like
        Kernel point to project from: the one that sees the surface under the largest solid angle, the one
        deepest inside, the centroid of the kernel, or one with the least area distortion (a local search).
        "relaxed" is `best_center(surface).point`, for surfaces without a kernel. A point is taken as it is.
    clearance : float
        "coverage" and "distortion" look only at points this far from every facet plane, mesh units, >= 0. At 0
        the best point usually lies in facet planes: those facets are seen edge-on.
    domain : {"ball", "hull", "box"}, Domain, HalfSpaces or (normals, offsets), optional
        Where a centre is looked for, as for `exact_kernel`.
    facets : int array or bool mask, optional
        Restrict the surface to these facets.

    Returns
    -------
    SphericalMap
        Centre, directions and radii per vertex, solid angle, and what is hidden.

    Raises
    ------
    MeshError, MeshReadError, TypeError
        If the surface cannot be used.
    ValueError
        If the kernel is empty and the centre is to be chosen from it, or an option cannot be used.

    Notes
    -----
    The solid angle is the sum of the signed angles of the triangles [2]_, in the order of the faces. Off the
    boundary curve of the surface it is a harmonic function of the centre, so its maximum over the kernel lies
    on the kernel's boundary. Its gradient and Hessian are line integrals over the boundary curve alone, and
    "coverage" climbs along the kernel's faces from its best corners, face centres and points in fixed directions;
    the certificate says how well the gradient is a combination of facet normals there. Inside a closed surface
    every kernel point sees 4 pi, and "coverage" takes the deepest one.

    A centre chosen from a solid kernel is moved towards the deepest point, by 2**-52 of the way or little more,
    until it is strictly on the inner side of all facets and off the surface; of a kernel without volume it is a
    rounded point.

    References
    ----------
    .. [1] N. Werghi, "The Discrete Surface Kernel: Framework and Applications", 2008, section 4.A.
    .. [2] A. van Oosterom, J. Strackee, "The solid angle of a plane triangle", IEEE Trans. Biomed. Eng. 30,
       1983, doi:10.1109/TBME.1983.325207.

    Examples
    --------
    >>> import voxkernel
    >>> corners = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]
    >>> box = [[0, 3, 2, 1], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]  # no lid
    >>> seen = voxkernel.spherical_map((corners, box), center=[0.5, 0.5, 0.5])
    >>> round(seen.coverage, 12)
    0.833333333333
    >>> best = voxkernel.spherical_map((corners, box))  # a lower corner sees the lid as a twenty-fourth
    >>> round(best.coverage, 9), round(23 / 24, 9)
    (0.958333333, 0.958333333)
    """
    mesh = as_mesh(surface, facets=facets)
    margin = as_nonnegative("clearance", clearance)
    if isinstance(center, str):
        if center not in CENTERS:
            raise ValueError(f"`center` must be a point or one of {', '.join(CENTERS)}; got {center!r}")
        if center == "relaxed":
            found = best_center(mesh, domain=domain)
            return _project(mesh, HalfSpaces.from_mesh(mesh), found.point, center, notes=_relaxed_notes(found))
        return _from_kernel(mesh, center, margin, domain)
    point = as_points("center", np.asarray(center)[None])[0].copy()
    return _project(mesh, HalfSpaces.from_mesh(mesh), point, "point", notes=_outside_notes(mesh, point, domain))


def _outside_notes(mesh: TriangleMesh, point: NDArray[np.float64], domain: Any) -> tuple[str, ...]:
    """A point that no search would have looked at is mostly a slip: other units, another frame."""
    argument = surface_argument(mesh)
    region = argument.bounded_domain(argument.domain(domain, EXACT))
    beyond = float((region.normals @ point - region.offsets).max())
    if beyond <= 0.0:
        return ()
    return (f"the centre lies outside the domain ({region.kind}), by {beyond:.3g}",)


def _relaxed_notes(found: Any) -> tuple[str, ...]:
    low, high = found.violation_bounds
    if high == 0.0:
        return ("the kernel is not empty: the centre is its deepest point",)
    return (f"no point faces all of the surface; the least that is turned away is {low:.3g} to {high:.3g} of the area",)


def _from_kernel(mesh: TriangleMesh, kind: str, margin: float, domain: Any) -> SphericalMap:
    argument = surface_argument(mesh)
    halfspaces, region = argument.halfspaces, argument.domain(domain, EXACT)
    kernel = kernel_of_halfspaces(halfspaces, region)
    if kernel.is_empty:
        ids = ", ".join(str(i) for i in kernel.certificate.facet_ids if i >= 0)
        where = "" if kernel.unclipped_dimension < 0 else f" inside the {region.kind if region else 'domain'}"
        raise ValueError(
            f"`center` must be a point or 'relaxed' where the kernel is empty{where}; got {kind!r} (no point is on "
            f"the inner side of facets {ids} at once; center=best_center(surface).point turns away the least area)"
        )
    notes: list[str] = []
    proof = None
    if kind == "deepest":
        point = kernel.deepest_point
    elif kind == "centroid":
        point = kernel.centroid
    else:
        searched, planes = _shrunken(kernel, halfspaces, region, margin)
        found = None
        if kind == "coverage":
            found = coverage_optimum(mesh, kernel_region(searched, planes))
        if kind == "distortion":
            point = _least_distorted(mesh, searched, planes)
        elif found is None:
            point = kernel.deepest_point
            notes.append("the surface has no boundary: every kernel point sees the same, the deepest one was taken")
        else:
            point, proof = found
            if (proof.active_facets < 0).any():
                notes.append("the domain holds the best centre: points outside it may see more")
            elif kernel.dimension == 3 and margin == 0.0:
                notes.append("the best centre lies in facet planes; `clearance` keeps away from them")
            if proof.touches_boundary:
                notes.append("the kernel touches the boundary curve, where the solid angle jumps")
    if kernel.dimension < 3:
        name = ("point", "segment", "flat polygon")[kernel.dimension]
        notes.append(f"the kernel is only a {name}: its points are rounded")
    return _project(mesh, halfspaces, point, kind, kernel=kernel, proof=proof, notes=tuple(notes))


def _shrunken(
    kernel: KernelPolytope, halfspaces: HalfSpaces, region: Domain | None, margin: float
) -> tuple[KernelPolytope, HalfSpaces]:
    """The part of a kernel that keeps clear of all facet planes, with the planes that bound it."""
    if margin == 0.0:
        return kernel, halfspaces
    moved = HalfSpaces.from_planes(halfspaces.normals, halfspaces.offsets - margin)
    moved = replace(moved, facet_ids=halfspaces.facet_ids)
    inner = kernel_of_halfspaces(moved, region)
    if inner.dimension < 3:
        raise ValueError(
            f"`clearance` must be below {kernel.clearance:.6g}, that of the deepest kernel point; got {margin:g}"
        )
    return inner, moved


def _least_distorted(mesh: TriangleMesh, kernel: KernelPolytope, planes: HalfSpaces) -> NDArray[np.float64]:
    region = kernel_region(kernel, planes)
    starts = [kernel.deepest_point, kernel.centroid]
    best = coverage_optimum(mesh, region)
    if best is not None:
        starts.append(best[0])
    return distortion_optimum(mesh, mesh.facet_areas, region, starts)


def _turned_away(halfspaces: HalfSpaces, center: NDArray[np.float64]) -> NDArray[np.int64]:
    """Half-spaces a point is strictly outside of, exact; rationals only where floating point cannot tell."""
    exact = halfspaces.world_to_lattice([Fraction(float(v)) for v in center])
    ids = planes_not_clear(halfspaces, exact)
    local = halfspaces.to_local(center)
    slack = halfspaces.local_offsets[ids] - halfspaces.local_normals[ids] @ local
    certain = slack < -(halfspaces.local_errors[ids] * (float(np.linalg.norm(local)) + 1.0) + 1e-12)
    open_ids = ids[~certain]
    outside = [s < 0 for s in exact_slacks(halfspaces, open_ids, exact)]
    return np.sort(np.concatenate([ids[certain], open_ids[np.array(outside, dtype=bool)]]))


def _strictly_inside(
    mesh: TriangleMesh, halfspaces: HalfSpaces, kernel: KernelPolytope, point: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Move a kernel point towards the deepest one until it is off all facet planes and clear of the triangles."""
    if kernel.dimension < 3:
        return point
    size = float(np.linalg.norm(np.ptp(mesh.used_vertices, axis=0)))
    boundary = None
    for bits in (None, *range(52, 19, -2)):
        moved = point if bits is None else point + (kernel.deepest_point - point) * 2.0**-bits
        exact = halfspaces.world_to_lattice([Fraction(float(v)) for v in moved])
        if any(s <= 0 for s in exact_slacks(halfspaces, planes_not_clear(halfspaces, exact), exact)):
            continue
        if float((halfspaces.offsets - halfspaces.normals @ moved).min()) > 1e-6 * size:
            return moved
        boundary = boundary or Boundary.of(mesh)
        if agrees_with_boundary(mesh, boundary, moved):
            return moved
    return kernel.deepest_point


def _project(
    mesh: TriangleMesh,
    halfspaces: HalfSpaces,
    point: NDArray[np.float64],
    kind: str,
    *,
    kernel: KernelPolytope | None = None,
    proof: CoverageCertificate | None = None,
    notes: tuple[str, ...] = (),
) -> SphericalMap:
    """Measure everything at a centre."""
    if kernel is None:
        violated = _turned_away(halfspaces, point)
    else:
        point = _strictly_inside(mesh, halfspaces, kernel, point)
        violated = np.zeros(0, np.int64)
    center = read_only(np.array(point, dtype=np.float64))
    angles, total, size = solid_angles(mesh, center, facet_sides(mesh, halfspaces, violated))
    directions, radii = np.empty((len(mesh.vertices), 3)), np.empty(len(mesh.vertices))
    directions_and_radii(mesh.vertices, center, directions, radii)
    weights = halfspaces.weights
    hidden = float(weights[violated].sum() / weights.sum()) if len(violated) else 0.0
    if (radii[mesh.faces.reshape(-1)] == 0.0).any():
        notes = (*notes, "the centre is a vertex of the surface, which has no direction")
    return SphericalMap(
        mesh=mesh,
        center=center,
        center_kind=kind,
        solid_angle=total,
        directions=read_only(directions),
        radii=read_only(radii),
        triangle_angles=read_only(angles),
        hidden_fraction=hidden,
        hidden_angle_fraction=max(0.0, 1.0 - abs(total) / size) if len(violated) and size > 0.0 else 0.0,
        folded_facets=read_only(np.unique(halfspaces.facet_ids[violated])),
        clearance=float((halfspaces.offsets - halfspaces.normals @ center).min()),
        distortion=_distortion(mesh, np.abs(angles)),
        certificate=proof,
        kernel=kernel,
        notes=notes,
    )


def _distortion(mesh: TriangleMesh, angles: NDArray[np.float64]) -> float:
    areas = mesh.facet_areas
    real = areas > 0.0
    size = float(angles[real].sum())
    if not size > 0.0:
        return float("nan")
    ratio = float((angles[real] ** 2 / areas[real]).sum()) * float(areas[real].sum()) / size**2
    return float(np.sqrt(max(0.0, ratio - 1.0)))
