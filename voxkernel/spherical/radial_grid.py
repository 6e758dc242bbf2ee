"""The radius of a surface around a centre on a grid of directions, and back to a surface."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from voxkernel._checks import as_depth, as_nonnegative, read_only
from voxkernel._core import settle_rays, triangle_distances
from voxkernel._frozen import Frozen
from voxkernel._notebook import html_of
from voxkernel._open3d import open3d, ray_scene
from voxkernel.errors import MeshError
from voxkernel.mesh import TriangleMesh
from voxkernel.mesh.edges import half_edges
from voxkernel.mesh.triangles import triple_products, without_strays
from voxkernel.spherical.harmonics import MAX_DEGREE, Harmonics, fit_harmonics
from voxkernel.spherical.sphere_grids import GridKind, SphereGrid, sphere_grid

__all__ = ["RadialGrid", "ReconstructionError", "grid_triangles", "reconstruction_error", "sample_radii"]

_MISSED = 2**32 - 1  # Open3D's id where a ray hits nothing
_SLACK = 1e-6  # a float32 hit is trusted where the ray misses the triangle by less than this sine
_JITTER = 2e-6
_STEPS = 64


class ReconstructionError(NamedTuple):
    """How far two surfaces are apart.

    Attributes
    ----------
    hausdorff : float
        Largest distance of a vertex or triangle centre of either surface from the other, mesh units.
    rms : float
        Root mean square, with triangle areas as weights, over the triangle centres of both, mesh units.
    """

    hausdorff: float
    rms: float

    _repr_html_ = html_of


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class RadialGrid(Frozen):
    """Radii of a surface around a centre, in the directions of a grid.

    Attributes
    ----------
    grid : SphereGrid
        The directions: `grid.directions()`, `grid.angles()`, `grid.weights`.
    center : (3,) float64
        Where radii are measured from, world coordinates.
    radii : (n, 2 n) or (12 n^2,) float64
        Distance to the first facet along each direction, mesh units; NaN where there is none.
    triangles : int64, as `radii`
        The triangle (row of `mesh.faces`) each ray meets, -1 for none.
    pole_radii : (2,) float64
        Radii straight up (+z) and down.
    """

    grid: SphereGrid
    center: NDArray[np.float64]
    radii: NDArray[np.float64]
    triangles: NDArray[np.int64]
    pole_radii: NDArray[np.float64]

    def __repr__(self) -> str:
        """Name the grid and how much of it is seen."""
        return f"RadialGrid({self.grid.kind!r}, n={self.grid.n}, covered={self.covered:.4g})"

    @property
    def mask(self) -> NDArray[np.bool_]:
        """Where the surface is seen, of the shape of `radii`."""
        return np.isfinite(self.radii)

    @property
    def covered(self) -> float:
        """Share of the sphere in which the surface is seen."""
        return float(self.grid.weights[self.mask.reshape(-1)].sum()) / (4.0 * np.pi)

    @property
    def points(self) -> NDArray[np.float64]:
        """World points on the surface, (number of directions, 3); NaN where it is not seen."""
        return self.center + self.radii.reshape(-1, 1) * self.grid.directions()

    def reconstruct(self) -> TriangleMesh:
        """Make a surface of the points of the grid.

        Returns
        -------
        TriangleMesh
            Cells of the grid in two triangles each and a fan at each pole; HEALPix points are joined by
            their convex hull. Triangles with a corner that is not seen are left out.

        Raises
        ------
        MeshError
            If no triangle is left.
        """
        triangles = grid_triangles(self.grid)
        poles = self.center + np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]) * self.pole_radii[:, None]
        points = np.concatenate([self.points, poles])
        seen = np.isfinite(points[:, 0])
        triangles = triangles[seen[triangles].all(axis=1)]
        if not len(triangles):
            raise MeshError(f"`radii` must be known at the corners of a triangle; got {int(seen.sum())} points")
        used = np.zeros(len(points), bool)
        used[triangles] = True
        number = np.cumsum(used) - 1
        return TriangleMesh.from_triangles(points[used], number[triangles], source="spherical map")

    def harmonics(self, degree: int | None = None, *, regularisation: float | None = None) -> Harmonics:
        """Expand the radius in spherical harmonics.

        Parameters
        ----------
        degree : int, optional
            Largest degree, 0 to 256; the largest the grid resolves up to 64 by default.
        regularisation : float, optional
            Weight of the squared Laplacian, >= 0: a wave of degree l is damped by 1 + w (l (l + 1))^2. By default
            0 where the whole sphere is seen (plain quadrature) and 1e-8 where a part is missing.

        Returns
        -------
        Harmonics
            Coefficients, energies per degree, and what the fit leaves.

        Raises
        ------
        ValueError
            If the grid is too coarse for `degree`, or no direction is seen.
        """
        top = min(64, self.grid.max_degree) if degree is None else as_depth("degree", degree, 0, MAX_DEGREE)
        if regularisation is None:
            weight = 0.0 if bool(self.mask.all()) else 1e-8
        else:
            weight = as_nonnegative("regularisation", regularisation)
        return fit_harmonics(self.grid, self.radii, top, weight, self.center)


def sample_radii(mesh: TriangleMesh, center: NDArray[np.float64], kind: GridKind, n: int) -> RadialGrid:
    """Cast a ray along every direction of a grid and compute the radius from the plane of the triangle met."""
    grid = sphere_grid(kind, n)
    directions = np.concatenate([grid.directions(), [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]])
    radii, triangles = ray_radii(mesh, center, directions)
    return RadialGrid(
        grid, center, read_only(radii[:-2].reshape(grid.shape)), read_only(triangles[:-2].reshape(grid.shape)),
        read_only(radii[-2:].copy()),
    )  # fmt: skip


def ray_radii(
    mesh: TriangleMesh, center: NDArray[np.float64], directions: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Distance to the surface along unit directions, and the triangle met; NaN and -1 where there is none.

    Open3D finds the triangle in single precision. In double precision the ray may pass a neighbour: it is
    followed there, and the distance is that of the triangle's plane.
    """
    o3d = open3d()
    corners = mesh.vertices - center
    size = float(np.abs(corners[mesh.faces.reshape(-1)]).max()) or 1.0
    scene = ray_scene(corners / size, mesh.faces)

    def cast(rays: NDArray[np.float64]) -> NDArray[np.int64]:
        both = np.zeros((len(rays), 6), np.float32)
        both[:, 3:] = rays
        ids = scene.cast_rays(o3d.core.Tensor(both))["primitive_ids"].numpy()
        return np.where(ids == _MISSED, -1, ids.astype(np.int64))

    hits = cast(directions)
    missed = np.flatnonzero(hits < 0)
    if len(missed):  # a ray may slip between two triangles
        rays = directions[missed]
        hits[missed] = cast(rays + _JITTER * np.roll(rays, 1, axis=1))
    radii = np.empty(len(directions))
    settle_rays(corners, mesh.faces, _across(mesh), directions, hits, _SLACK, _STEPS, radii)
    return radii, hits


def _across(mesh: TriangleMesh) -> NDArray[np.int64]:
    """Neighbour of each triangle over each edge where exactly two triangles meet, else -1; (m, 3)."""
    edges = half_edges(mesh.faces, len(mesh.vertices))
    one, other = edges.pairs()
    across = np.full(3 * len(mesh.faces), -1, np.int64)
    across[one], across[other] = other // 3, one // 3
    return across.reshape(-1, 3)


def grid_triangles(grid: SphereGrid) -> NDArray[np.int64]:
    """Triangles over the points of a grid, counter-clockwise from outside; the last two ids are the poles."""
    if not grid.is_rectangular:
        return _hull_triangles(grid.directions())
    rows, columns = grid.shape
    ids = np.arange(rows * columns).reshape(rows, columns)
    a, b = ids[:-1], ids[1:]
    c, d = np.roll(b, -1, axis=1), np.roll(a, -1, axis=1)
    north, south = rows * columns, rows * columns + 1
    caps = [
        np.stack([np.full(columns, north), ids[0], np.roll(ids[0], -1)], axis=1),
        np.stack([np.full(columns, south), np.roll(ids[-1], -1), ids[-1]], axis=1),
    ]
    cells = np.stack([np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)], axis=-2).reshape(-1, 3)
    return np.concatenate([caps[0], cells, caps[1]])


def _hull_triangles(points: NDArray[np.float64]) -> NDArray[np.int64]:
    from scipy.spatial import ConvexHull

    hull = ConvexHull(points)
    triangles = np.asarray(hull.simplices, dtype=np.int64)
    p, q, r = (points[triangles[:, k]] for k in range(3))
    inward = triple_products(r, p, q) < 0.0
    triangles[inward] = triangles[inward][:, ::-1]
    return triangles


def reconstruction_error(one: TriangleMesh, other: TriangleMesh) -> ReconstructionError:
    """Measure two surfaces against each other."""
    there, there_centers = _distances(one, other)
    back, back_centers = _distances(other, one)
    weights = [one.facet_areas, other.facet_areas]
    mean = sum(float((w * d**2).sum()) for w, d in zip(weights, (there_centers, back_centers), strict=True))
    rms = float(np.sqrt(mean / float(weights[0].sum() + weights[1].sum())))
    return ReconstructionError(float(max(a.max() for a in (there, there_centers, back, back_centers))), rms)


def _distances(source: TriangleMesh, target: TriangleMesh) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Distance from `target` of the used vertices and of the triangle centres of `source`."""
    o3d: Any = open3d()
    vertices = source.used_vertices
    corners, faces = without_strays(target.vertices, target.faces)
    points = np.concatenate([vertices, source.vertices[source.faces].mean(axis=1)])
    middle = corners.mean(axis=0)
    size = float(np.abs(corners - middle).max()) or 1.0
    scene = ray_scene((corners - middle) / size, faces)
    query = o3d.core.Tensor(((points - middle) / size).astype(np.float32))
    nearest = scene.compute_closest_points(query)["primitive_ids"].numpy().astype(np.int64)
    distances = np.empty(len(points))
    triangle_distances(points, corners[faces[nearest]], distances)
    return distances[: len(vertices)], distances[len(vertices) :]
