"""What registration needs to know of one surface: samples, normals, kernel moments, all in its own frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from voxkernel._frozen import Frozen
from voxkernel.errors import MeshError
from voxkernel.halfspaces.area_moments import moments_of_blocks
from voxkernel.halfspaces.local_frame import check_extent
from voxkernel.halfspaces.surface_arguments import REGISTRATION, surface_argument
from voxkernel.measures import KernelMoments, kernel_moments
from voxkernel.mesh import TriangleMesh
from voxkernel.mesh.surface_samples import spread_samples
from voxkernel.mesh.triangles import bounds_of, doubled_normals, without_strays
from voxkernel.registration.thin import clustered, smoothed, thinned
from voxkernel.relaxed import best_center
from voxkernel.voxels import KernelGrid, voxel_kernels

__all__ = ["PreparedSurface", "Rim", "Samples", "Skin", "kernels_of", "prepare", "rim_of", "samples_of", "simplified"]

KERNEL_DEPTH = 5
_CENTER_GAP = 2e-3
_COARSE_SAMPLES = 800
_FINE_SAMPLES = 4000
_MOST_SAMPLES = 20_000
_FACETS_PER_STEP = 1500
_MOST_STEPS = 10
_SCRAMBLE = 2654435761, 2246822519  # odd, about the size of 2^32
_CELL = 1 / 30  # of the diagonal: edge of the cells whose vertices become one before the kernel


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Samples(Frozen):
    """Points on a surface and the outward unit normals there."""

    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    n_vertices: int = 0  # the first ones are vertices of the surface


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Rim(Frozen):
    """Which edges (opposite each corner of a facet) and which vertices lie on the rim of a surface."""

    edges: NDArray[np.bool_]
    vertices: NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Skin(Frozen):
    """Triangles, the unit normals of their smoothed copies, and the rim."""

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    normals: NDArray[np.float64]
    rim: Rim


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class PreparedSurface(Frozen):
    """One surface in its own frame: centroid at 0, principal axes as coordinate axes, mesh units.

    `T_world_local` leads back. `skin` is a copy of at most some 20,000 facets, `smooth` its vertices after
    smoothing, `kernels` the relaxed kernels of a copy of that, thinned once more, one per margin.
    """

    mesh: TriangleMesh
    T_world_local: NDArray[np.float64]
    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    diagonal: float
    area: float
    skin: Skin
    smooth: NDArray[np.float64]
    margins: tuple[float, ...]
    kernels: tuple[KernelGrid, ...]
    moments: tuple[KernelMoments, ...]
    coarse: Samples
    fine: Samples


def prepare(mesh: TriangleMesh, margins: tuple[float, ...]) -> PreparedSurface:
    """Sample a surface, smooth and thin a copy of it, and compute the relaxed kernels of that copy."""
    check_extent(mesh)
    corners, faces = _connected(mesh)
    moments = moments_of_blocks([(corners, faces)], *bounds_of(corners))
    if moments.scaled_area == 0.0:
        raise MeshError("`mesh` must have an area that floating point can see; got needles only")
    # Facets as points in their middles, which unlike `surface_frame` need not know triangles inside out.
    centroid, axes, area = moments.centroid, moments.axes(moments.second), moments.area
    vertices = _turned(corners - centroid, axes)
    low, high = bounds_of(vertices)
    diagonal = float(np.linalg.norm(high - low))
    T_world_local = np.eye(4)
    T_world_local[:3, :3], T_world_local[:3, 3] = axes.T, centroid
    thin, thin_faces = thinned(vertices, faces, area)
    smooth = _smoothed(thin, thin_faces)
    few = simplified(smooth, thin_faces, diagonal)
    kernels = kernels_of(few, margins)
    vectors = 0.5 * doubled_normals(smooth[thin_faces])
    return PreparedSurface(
        mesh, T_world_local, vertices, faces, diagonal, area,
        Skin(thin, thin_faces, _unit(vectors), rim_of(thin_faces, len(thin))), smooth, margins, kernels,
        tuple(kernel_moments(k) for k in kernels),
        samples_of(*few, _COARSE_SAMPLES), _fine_samples(vertices, faces),
    )  # fmt: skip


def _turned(points: NDArray[np.float64], axes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Coordinates along axes, the rows of a matrix; the sums have one order, whatever the number of points."""
    x, y, z = points.T
    return np.column_stack([x * row[0] + y * row[1] + z * row[2] for row in axes])


def rim_of(faces: NDArray[np.int64], count: int) -> Rim:
    """Find the edges that belong to one facet only.

    Where facets around a vertex close, as many edges lead to each neighbour as come from it, so that sums of the
    neighbours' numbers are the same both ways. Of the others, a few, edges between two are counted one by one. The
    numbers are scrambled, because those of a regular grid have equal sums by chance.
    """
    ends = faces[:, [1, 2, 0]], faces[:, [2, 0, 1]]  # of the edges opposite each corner
    start, end = (e.ravel() for e in ends)
    differ = np.zeros(count, np.bool_)
    for factor in _SCRAMBLE:
        weights = _scrambled(count, factor)
        leaving = np.bincount(start, weights=weights[end], minlength=count)
        differ |= leaving != np.bincount(end, weights=weights[start], minlength=count)
    edges = np.zeros(faces.size, np.bool_)
    wanted = np.flatnonzero(differ[start] & differ[end])
    one, two = start[wanted], end[wanted]
    keys = np.minimum(one, two) * np.int64(count) + np.maximum(one, two)
    _, place, number = np.unique(keys, return_inverse=True, return_counts=True)
    edges[wanted] = (number == 1)[place.ravel()]
    vertices = np.zeros(count, np.bool_)
    vertices[start[edges]] = vertices[end[edges]] = True
    return Rim(edges.reshape(faces.shape), vertices)


def _scrambled(count: int, factor: int) -> NDArray[np.float64]:
    """Whole numbers below 2^32, one for each vertex, whose sums are equal by no rule (xorshift and multiply)."""
    numbers = np.arange(1, count + 1, dtype=np.uint64)
    for _ in range(2):
        numbers = numbers * np.uint64(factor) % np.uint64(1 << 32)
        numbers ^= numbers >> np.uint64(15)
    return numbers.astype(np.float64)


def _connected(mesh: TriangleMesh) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Give the vertices in use; those of loose triangles are joined, or smoothing would shrink each to a point."""
    vertices, faces = without_strays(mesh.vertices, mesh.faces)
    if len(vertices) > len(faces):
        vertices, merged = np.unique(vertices, axis=0, return_inverse=True)
        faces = merged.ravel()[faces].reshape(faces.shape)
    return vertices, faces


def kernels_of(surface: tuple[NDArray[np.float64], NDArray[np.int64]], margins: tuple[float, ...]) -> Any:
    """Compute the relaxed kernels of a smoothed and thinned surface, one for each margin."""
    if not margins:
        return ()
    mesh = TriangleMesh.from_triangles(*surface, source="smoothed surface")
    ball = surface_argument(mesh).domain(None, REGISTRATION)
    # Not `margins`, which are counted from the least violation to 1e-4: this is near enough.
    least = best_center(mesh, gap=_CENTER_GAP, domain=ball).violation_bounds[1]
    return voxel_kernels(mesh, tolerances=[min(1.0, least + m) for m in margins], depth=KERNEL_DEPTH, domain=ball)


def _smoothed(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.float64]:
    """Average vertices with their neighbours, more often where the facets are smaller.

    Their number says how small they are; their area does not, because noise makes it grow.
    """
    steps = min(_MOST_STEPS, round(len(faces) / _FACETS_PER_STEP))
    return smoothed(vertices, faces, steps)


def simplified(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], diagonal: float
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Join the vertices in each cell of a grid, unless little would be left."""
    thin, triangles = clustered(vertices, faces, _CELL * diagonal)
    return (vertices, faces) if len(triangles) < min(len(faces), 100) else (thin, triangles)


def _unit(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    length = np.linalg.norm(rows, axis=1)
    return rows / np.where(length > 0, length, 1.0)[:, None]


def samples_of(vertices: NDArray[np.float64], faces: NDArray[np.int64], count: int) -> Samples:
    """Place about so many points on a surface, with the normals of their triangles."""
    points, owners, _ = spread_samples(vertices, faces, count)
    return Samples(points, _unit(0.5 * doubled_normals(vertices[faces]))[owners])


def _fine_samples(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> Samples:
    """Take vertices with normals from those of their facets, and points between them where they are few."""
    step = max(1, len(vertices) // _MOST_SAMPLES)
    shown = np.zeros(len(vertices), np.bool_)
    shown[::step] = True
    touched = faces if step == 1 else faces[shown[faces[:, 0]] | shown[faces[:, 1]] | shown[faces[:, 2]]]
    vectors = 0.5 * doubled_normals(vertices[touched])
    normals = np.zeros_like(vertices)
    for k in range(3):
        for axis in range(3):
            normals[:, axis] += np.bincount(touched[:, k], weights=vectors[:, axis], minlength=len(vertices))
    points, normals = vertices[shown], _unit(normals[shown])
    if len(vertices) < _FINE_SAMPLES:
        more, owners, _ = spread_samples(vertices, faces, _FINE_SAMPLES)
        points, normals = np.concatenate([points, more]), np.concatenate([normals, _unit(vectors)[owners]])
    return Samples(points, normals, n_vertices=len(vertices) if step == 1 else 0)
